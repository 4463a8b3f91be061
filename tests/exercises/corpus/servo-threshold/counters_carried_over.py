# mistake: One MjData is used for all runs and its warning counter is summed up without being reset, so after the first unstable run all seem unstable.
# next: Reset the count for each run, or make a new MjData.
# status: incorrect
# told: You use one data for every timestep and never call mujoco.mj_resetData
import mujoco

total = 0


def run(model, data, h):
    global total
    model.opt.timestep = h
    data.qpos[0] = 1.0
    data.qvel[0] = 0.0
    data.time = 0.0
    for _ in range(round(3 / h)):
        mujoco.mj_step(model, data)
        n = data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number + data.warning[mujoco.mjtWarning.mjWARN_BADQVEL].number
        if n:
            total += n
            break
    return total == 0


def largest_stable_timestep(model, integrator):
    global total
    total = 0
    model.opt.integrator = integrator
    data = mujoco.MjData(model)
    if run(model, data, 0.05):
        return None
    lo, hi = 0.001, 0.05
    while hi - lo > 0.0005:
        mid = (lo + hi) / 2
        if run(model, data, mid):
            lo = mid
        else:
            hi = mid
    return lo, hi
