# mistake: A linear scan in steps of 2 ms gives a bracket that is four times too wide.
# next: Bisect until the ends are no further apart than 0.5 ms.
# status: incorrect
# told: Your brackets hold the limit but are too wide: go on halving until they are no wider than
import mujoco
import numpy as np


def stable(model, integrator, h):
    model.opt.integrator = integrator
    model.opt.timestep = h
    data = mujoco.MjData(model)
    data.qpos[0] = 1.0
    for _ in range(int(np.ceil(3.0 / h))):
        mujoco.mj_step(model, data)
        if data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number > 0:
            return False
        if data.warning[mujoco.mjtWarning.mjWARN_BADQVEL].number > 0:
            return False
    return True


def largest_stable_timestep(model, integrator):
    last = 0.001
    for h in np.arange(0.002, 0.0501, 0.002):
        if not stable(model, integrator, h):
            return last, h
        last = h
    return None
