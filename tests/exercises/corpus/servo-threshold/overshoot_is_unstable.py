# mistake: Any overshoot beyond 0.8 rad on the other side counts as unstable, although the oscillation still decays.
# next: Count MuJoCo's warnings (or time running backwards), not overshoot.
# status: partial
# told: At 11.72 ms your run raised no warning within 0.023 s, where you ended it, and you call
import mujoco


class Experiment:
    def __init__(self, model, integrator):
        self.model = model
        self.model.opt.integrator = integrator
        self.data = mujoco.MjData(model)

    def stable(self, h):
        self.model.opt.timestep = h
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[0] = 1.0
        for _ in range(round(3.0 / h)):
            mujoco.mj_step(self.model, self.data)
            # starts at +1, must not swing through to the other side
            if self.data.qpos[0] < -0.8 or self.data.qpos[0] > 1.0001:
                return False
        return True


def largest_stable_timestep(model, integrator):
    e = Experiment(model, integrator)
    lo, hi = 0.001, 0.05
    if e.stable(hi):
        return None
    while hi - lo > 0.0005:
        mid = (lo + hi) / 2
        if e.stable(mid):
            lo = mid
        else:
            hi = mid
    return lo, hi
