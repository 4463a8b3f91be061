# mistake: Both ends are rounded to two decimals of a second, so that they become the same number.
# next: Return the numbers as they are.
# status: partial
# told: Your answer is rounded to 2 decimals of a second
import mujoco


def stable(model, integrator, h):
    model.opt.integrator = integrator
    model.opt.timestep = h
    data = mujoco.MjData(model)
    data.qpos[0] = 1
    while data.time < 3:
        mujoco.mj_step(model, data)
        if any(w.number for w in data.warning):
            return False
    return True


def largest_stable_timestep(model, integrator):
    lo, hi = 0.001, 0.05
    if stable(model, integrator, hi):
        return None
    while hi - lo > 0.0005:
        mid = (lo + hi) / 2
        if stable(model, integrator, mid):
            lo = mid
        else:
            hi = mid
    return round(lo, 2), round(hi, 2)
