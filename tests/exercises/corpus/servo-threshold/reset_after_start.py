# mistake: mj_resetData comes after qpos[0] = 1 and undoes it: the run starts at 0
# status: incorrect
# told: Your runs start with hinge at 0, where nothing moves, so that nothing can grow.
import mujoco

WARNINGS = (mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADQVEL, mujoco.mjtWarning.mjWARN_BADQACC)


class Servo:
    def __init__(self, model, integrator):
        self.model = model
        self.model.opt.integrator = integrator
        self.data = mujoco.MjData(model)

    def unstable(self, timestep):
        self.model.opt.timestep = timestep
        self.data.qpos[0] = 1
        mujoco.mj_resetData(self.model, self.data)  # clears the warnings of the last run
        for _ in range(int(3 / timestep) + 1):
            mujoco.mj_step(self.model, self.data)
        return any(self.data.warning[w].number > 0 for w in WARNINGS)


def largest_stable_timestep(model, integrator):
    servo = Servo(model, integrator)
    low, high = 0.001, 0.05
    if not servo.unstable(high):
        return None
    while high - low > 0.0005:
        mid = 0.5 * (low + high)
        if servo.unstable(mid):
            high = mid
        else:
            low = mid
    return low, high
