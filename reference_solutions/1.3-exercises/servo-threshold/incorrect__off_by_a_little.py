# diagnosis: 1.01 times what it found
"""The bracket of a right bisection, moved up by 1 %: its ends were never tried."""

import mujoco


def is_stable(model, integrator, h):
    model.opt.integrator, model.opt.timestep = integrator, h
    data = mujoco.MjData(model)
    data.qpos[0] = 1.0
    mujoco.mj_step(model, data, round(3 / h))
    return not any(warning.number for warning in data.warning)


def largest_stable_timestep(model, integrator):
    low, high = 0.001, 0.05
    if is_stable(model, integrator, high):
        return None
    while high - low > 0.00001:
        middle = (low + high) / 2
        if is_stable(model, integrator, middle):
            low = middle
        else:
            high = middle
    return 1.01 * low, 1.01 * high
