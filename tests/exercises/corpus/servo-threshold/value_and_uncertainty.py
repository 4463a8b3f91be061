# mistake: The two returned numbers are a value and its uncertainty, not the two ends of the bracket.
# next: Return (h_stable, h_unstable).
# status: incorrect
# told: it seems to be the uncertainty of the first
import mujoco


def unstable(model, h):
    model.opt.timestep = h
    data = mujoco.MjData(model)
    data.qpos[0] = 1.0
    for _ in range(int(3 / h)):
        mujoco.mj_step(model, data)
        if any(w.number for w in data.warning):
            return True
    return False


def largest_stable_timestep(model, integrator):
    model.opt.integrator = integrator
    lo, hi = 0.001, 0.05
    if not unstable(model, hi):
        return None
    while hi - lo > 0.0004:
        mid = (lo + hi) / 2
        if unstable(model, mid):
            hi = mid
        else:
            lo = mid
    h = (lo + hi) / 2
    dh = (hi - lo) / 2
    return h, dh
