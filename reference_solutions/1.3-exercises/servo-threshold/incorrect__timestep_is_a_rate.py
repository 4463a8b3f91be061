# diagnosis: far beyond 50 ms
import mujoco
import numpy as np

def run(model, integrator, dt, T=3.0):
    model.opt.integrator = integrator
    model.opt.timestep = 1 / dt
    d = mujoco.MjData(model)
    d.qpos[0] = 1.0
    n = int(round(T / dt))
    for i in range(n):
        mujoco.mj_step(model, d)
        if d.warning[mujoco.mjtWarning.mjWARN_BADQACC].number or d.warning[mujoco.mjtWarning.mjWARN_BADQPOS].number or d.warning[mujoco.mjtWarning.mjWARN_BADQVEL].number:
            return False
    return True

def largest_stable_timestep(model, integrator):
    lo, hi = 0.001, 0.05
    if run(model, integrator, hi):
        return None
    while hi - lo > 0.0004:
        mid = (lo + hi) / 2
        if run(model, integrator, mid):
            lo = mid
        else:
            hi = mid
    return lo, hi
