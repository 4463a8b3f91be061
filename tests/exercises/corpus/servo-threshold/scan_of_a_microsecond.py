# mistake: A linear scan in steps of 1 microsecond needs tens of thousands of runs and does not end in time.
# next: Bisect: seven runs are enough for 0.5 ms.
# status: timed_out
# told: The script used up its CPU time of 20 s.
import mujoco
import numpy as np


def stable(model, h):
    model.opt.timestep = h
    data = mujoco.MjData(model)
    data.qpos[0] = 1.0
    for _ in range(round(3 / h)):
        mujoco.mj_step(model, data)
        if data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number:
            return False
    return True


def largest_stable_timestep(model, integrator):
    model.opt.integrator = integrator
    step = 1e-6
    for h in np.arange(0.001, 0.05, step):
        if not stable(model, h):
            return h - step, h
    return None
