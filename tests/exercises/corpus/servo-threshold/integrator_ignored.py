# mistake: The parameter `integrator` is never used, so every call measures the model's default, Euler.
# next: Set model.opt.integrator = integrator.
# status: partial
# told: Your runs used Euler where another integrator was asked
import mujoco


def stable(m, h):
    m.opt.timestep = h
    d = mujoco.MjData(m)
    d.qpos[0] = 1.0
    last = -1.0
    for _ in range(round(3.0 / h)):
        mujoco.mj_step(m, d)
        if d.time < last:
            return False
        last = d.time
    return True


def largest_stable_timestep(model, integrator):
    lo, hi = 0.001, 0.05
    if stable(model, hi):
        return None
    while hi - lo > 0.0005:
        mid = (lo + hi) / 2
        if stable(model, mid):
            lo = mid
        else:
            hi = mid
    return lo, hi
