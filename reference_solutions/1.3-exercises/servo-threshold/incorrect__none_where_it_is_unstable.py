# diagnosis: turn the condition round on which it returns None
import mujoco
def stable(model, integrator, h):
    model.opt.integrator = integrator
    model.opt.timestep = h
    data = mujoco.MjData(model)
    data.qpos[0] = 1.0
    for _ in range(int(3.0 / h)):
        mujoco.mj_step(model, data)
    return data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number == 0
def largest_stable_timestep(model, integrator):
    if not stable(model, integrator, 0.05): return None
    lo, hi = 0.001, 0.05
    while hi - lo > 0.0005:
        mid = (lo + hi) / 2
        if stable(model, integrator, mid): lo = mid
        else: hi = mid
    return lo, hi
