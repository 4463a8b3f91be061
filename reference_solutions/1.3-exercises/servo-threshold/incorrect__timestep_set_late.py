# diagnosis: Set it before the first step
import mujoco
def stable(model, integrator, h):
    model.opt.integrator = integrator
    data = mujoco.MjData(model)
    data.qpos[0] = 1.0
    for _ in range(int(3.0 / h)):
        mujoco.mj_step(model, data)
    model.opt.timestep = h
    return data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number == 0
def largest_stable_timestep(model, integrator):
    if stable(model, integrator, 0.05): return None
    lo, hi = 0.001, 0.05
    while hi - lo > 0.0005:
        mid = (lo + hi) / 2
        if stable(model, integrator, mid): lo = mid
        else: hi = mid
    return lo, hi
