# mistake: The attribute is data.warning, without an s.
# next: Write data.warning.
# status: crashed
# told: did you mean warning?
import mujoco


def stable(model, integrator, h):
    model.opt.integrator = integrator
    model.opt.timestep = h
    data = mujoco.MjData(model)
    data.qpos[0] = 1
    while data.time < 3:
        mujoco.mj_step(model, data)
        if any(w.number for w in data.warnings):
            return False
    return True


def largest_stable_timestep(model, integrator):
    low, high = 0.001, 0.05
    if stable(model, integrator, high):
        return None
    while high - low > 0.0005:
        mid = (low + high) / 2
        if stable(model, integrator, mid):
            low = mid
        else:
            high = mid
    return low, high
