# mistake: A misspelt name raises an error in every run, and the bare except takes that for stable.
# next: Remove the try, and read data.warning[...].number.
# status: incorrect
# told: Line 15 raised an
import mujoco


def check(model, integrator, h):
    try:
        model.opt.integrator = integrator
        model.opt.timestep = h
        data = mujoco.MjData(model)
        data.qpos[0] = 1.0
        for _ in range(round(3 / h)):
            mujoco.mj_step(model, data)
            if data.warnings[mujoco.mjtWarning.mjWARN_BADQACC].number > 0:
                return False
    except Exception:
        pass
    return True


def largest_stable_timestep(model, integrator):
    lo, hi = 0.001, 0.05
    if check(model, integrator, hi):
        return None
    while hi - lo > 0.0005:
        mid = 0.5 * (lo + hi)
        if check(model, integrator, mid):
            lo = mid
        else:
            hi = mid
    return lo, hi
