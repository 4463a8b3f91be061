# diagnosis: Your search ends at 30 ms
"""A search that ends too early, and takes its end for the limit."""

import mujoco


def is_stable(model, integrator, h):
    model.opt.integrator, model.opt.timestep = integrator, h
    data = mujoco.MjData(model)
    data.qpos[0] = 1.0
    for _ in range(round(3 / h)):
        mujoco.mj_step(model, data)
        if any(warning.number for warning in data.warning):
            return False
    return True


def largest_stable_timestep(model, integrator):
    low, high = 0.001, 0.03
    if is_stable(model, integrator, high):
        return None
    while high - low > 0.0005:
        middle = (low + high) / 2
        if is_stable(model, integrator, middle):
            low = middle
        else:
            high = middle
    return low, high
