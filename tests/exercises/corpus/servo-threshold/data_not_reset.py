# mistake: The same MjData goes through all runs without a reset; after an unstable run its warning counter is still set, and the state is the last run's.
# next: Call mj_resetData and set the start before each run, or make a new MjData.
# status: incorrect
# told: You use one data for every timestep and never reset
import mujoco


def largest_stable_timestep(model, integrator):
    model.opt.integrator = integrator
    data = mujoco.MjData(model)
    data.qpos[0] = 1.0

    def is_stable(h):
        model.opt.timestep = h
        for _ in range(round(3.0 / h)):
            mujoco.mj_step(model, data)
            if data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number > 0:
                return False
        return True

    lo, hi = 0.001, 0.05
    if is_stable(hi):
        return None
    while hi - lo > 0.0005:
        mid = (lo + hi) / 2
        if is_stable(mid):
            lo = mid
        else:
            hi = mid
    return lo, hi
