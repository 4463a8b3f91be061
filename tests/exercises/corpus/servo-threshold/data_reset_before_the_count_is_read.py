# mistake: data is reset at the end of the run, before data.warning is read, and a reset clears the counters.
# next: Read the counters first, then reset.
# status: incorrect
# told: Your script resets the data after the run, which sets data.warning back to 0
import mujoco

BAD = (mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADQVEL, mujoco.mjtWarning.mjWARN_BADQACC)


class Runner:
    def __init__(self, model):
        self.model = model
        self.data = mujoco.MjData(model)

    def run(self, h, seconds=3.0):
        self.model.opt.timestep = h
        self.data.qpos[0] = 1.0
        try:
            for _ in range(int(seconds / h)):
                mujoco.mj_step(self.model, self.data)
        finally:
            mujoco.mj_resetData(self.model, self.data)  # leave it clean for the next run
        return sum(self.data.warning[int(w)].number for w in BAD)


def largest_stable_timestep(model, integrator):
    model.opt.integrator = integrator
    runner = Runner(model)
    low, high = 0.001, 0.05
    if runner.run(high) == 0:
        return None
    while high - low > 0.0005:
        mid = (low + high) / 2
        if runner.run(mid):
            high = mid
        else:
            low = mid
    return low, high
