# diagnosis: The unstable end of your bracket is a thousand times one of your timesteps
import mujoco


def diverges(model, integrator, ms):
    model.opt.integrator = integrator
    model.opt.timestep = ms / 1000
    d = mujoco.MjData(model)
    d.qpos[0] = 1
    while d.time < 3:
        before = d.time
        mujoco.mj_step(model, d)
        if d.time < before:
            return True
    return False


def largest_stable_timestep(model, integrator):
    lo, hi = 1, 50
    if not diverges(model, integrator, hi):
        return None
    while hi - lo > 0.5:
        mid = (lo + hi) / 2
        if diverges(model, integrator, mid):
            hi = mid
        else:
            lo = mid
    return lo / 1000, hi
