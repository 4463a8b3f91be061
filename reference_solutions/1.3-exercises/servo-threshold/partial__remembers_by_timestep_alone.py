# diagnosis: in later calls it simulated nothing
import mujoco


def is_stable(model, integrator, timestep, seen={}):
    key = (integrator, round(timestep, 6))
    if key in seen:  # already simulated
        return seen[key]
    model.opt.integrator = integrator
    model.opt.timestep = timestep
    data = mujoco.MjData(model)
    data.qpos[0] = 1.0
    ok = True
    for _ in range(round(3.0 / timestep)):
        mujoco.mj_step(model, data)
        if data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number > 0:
            ok = False
            break
    seen[key] = ok
    return ok


def largest_stable_timestep(model, integrator):
    low, high = 0.001, 0.050
    if is_stable(model, integrator, high):
        return None
    while high - low > 0.0005:
        mid = (low + high) / 2
        if is_stable(model, integrator, mid):
            low = mid
        else:
            high = mid
    return low, high
