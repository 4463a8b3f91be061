# mistake: Results are cached by integrator, so the answer for the first model is given for all later models.
# next: Do not keep results between calls.
# status: partial
# told: The function gave the same answer for every model, although their limits
import mujoco

_cache = {}


def search(model, integrator):
    lo, hi = 0.001, 0.05
    if ok(model, integrator, hi):
        return None
    while hi - lo > 0.0005:
        mid = (lo + hi) / 2
        if ok(model, integrator, mid):
            lo = mid
        else:
            hi = mid
    return lo, hi


def ok(model, integrator, h):
    model.opt.integrator = integrator
    model.opt.timestep = h
    d = mujoco.MjData(model)
    d.qpos[0] = 1.0
    for _ in range(round(3 / h)):
        mujoco.mj_step(model, d)
        if d.warning[mujoco.mjtWarning.mjWARN_BADQACC].number or d.warning[mujoco.mjtWarning.mjWARN_BADQVEL].number:
            return False
    return True


def largest_stable_timestep(model, integrator):
    if integrator not in _cache:
        _cache[integrator] = search(model, integrator)
    return _cache[integrator]
