"""Whole runs in one call of mj_step each."""
import mujoco


def is_stable(model, data, h):
    model.opt.timestep = h
    mujoco.mj_resetData(model, data)
    data.qpos[0] = 1.0
    mujoco.mj_step(model, data, nstep=round(3 / h))
    return not data.warning.number.any()


def largest_stable_timestep(model, integrator):
    model.opt.integrator = integrator
    data = mujoco.MjData(model)
    low, high = 0.001, 0.05
    if is_stable(model, data, high):
        return None
    while high - low > 0.0005:
        middle = (low + high) / 2
        if is_stable(model, data, middle):
            low = middle
        else:
            high = middle
    return low, high
