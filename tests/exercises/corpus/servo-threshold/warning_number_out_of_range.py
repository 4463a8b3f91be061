# mistake: The loop over warnings runs up to a number that does not exist, which is an IndexError in a helper function.
# next: Use names such as mujoco.mjtWarning.mjWARN_BADQACC, or loop over data.warning itself.
# status: crashed
# told: IndexError, in line 12 of your
import mujoco

N_WARNINGS = 10


def count_warnings(data):
    n = 0
    for i in range(N_WARNINGS):
        n += data.warning[i].number
    return n


def rollout(model, h):
    model.opt.timestep = h
    data = mujoco.MjData(model)
    data.qpos[0] = 1.0
    for _ in range(round(3 / h)):
        mujoco.mj_step(model, data)
        if count_warnings(data):
            return False
    return True


def largest_stable_timestep(model, integrator):
    model.opt.integrator = integrator
    lo, hi = 0.001, 0.05
    if rollout(model, hi):
        return None
    while hi - lo > 0.0005:
        mid = (lo + hi) / 2
        if rollout(model, mid):
            lo = mid
        else:
            hi = mid
    return lo, hi
