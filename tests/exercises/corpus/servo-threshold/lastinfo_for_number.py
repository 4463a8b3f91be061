# mistake: It looks at data.warning[...].lastinfo, the number of the element that misbehaved (0 here), not at number, the count.
# next: Read data.warning[...].number.
# status: incorrect
# told: At 50 ms MuJoCo raised BADQACC and reset the state, and your answer calls that
import mujoco

BAD = (mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADQVEL, mujoco.mjtWarning.mjWARN_BADQACC)


def explodes(model, h):
    model.opt.timestep = h
    data = mujoco.MjData(model)
    data.qpos[0] = 1
    for _ in range(round(3 / h)):
        mujoco.mj_step(model, data)
        if any(data.warning[w].lastinfo for w in BAD):
            return True
    return False


def largest_stable_timestep(model, integrator):
    model.opt.integrator = integrator
    lo, hi = 0.001, 0.05
    if not explodes(model, hi):
        return None
    while hi - lo > 0.0005:
        mid = 0.5 * (lo + hi)
        if explodes(model, mid):
            hi = mid
        else:
            lo = mid
    return lo, hi
