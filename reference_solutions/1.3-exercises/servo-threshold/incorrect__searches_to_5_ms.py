# diagnosis: Your search ends at 5 ms
import mujoco
def unstable(model, integrator, h):
    model.opt.timestep = h; model.opt.integrator = integrator
    data = mujoco.MjData(model)
    data.qpos[0] = 1
    while data.time < 3:
        mujoco.mj_step(model, data)
        if data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number or data.warning[mujoco.mjtWarning.mjWARN_BADQPOS].number or data.warning[mujoco.mjtWarning.mjWARN_BADQVEL].number:
            return True
    return False
def largest_stable_timestep(model, integrator):
    lo, hi = 0.001, 0.005
    if not unstable(model, integrator, hi):
        return None
    while hi - lo > 0.0005:
        mid = (lo + hi) / 2
        if unstable(model, integrator, mid):
            hi = mid
        else:
            lo = mid
    return lo, hi
