# mistake: The search ends at 30 ms, so limits between 30 and 50 ms come out as None.
# next: Search up to 50 ms.
# status: partial
# told: Your search ends at 30 ms, where nothing is unstable
import mujoco

H_MIN = 1e-3
H_MAX = 30e-3
TOL = 0.5e-3


def simulate(model, h):
    """True if no warning within 3 s"""
    model.opt.timestep = h
    data = mujoco.MjData(model)
    data.qpos[0] = 1.0
    w = [data.warning[i] for i in (mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADQVEL, mujoco.mjtWarning.mjWARN_BADQACC)]
    for _ in range(round(3 / h)):
        mujoco.mj_step(model, data)
        if sum(x.number for x in w):
            return False
    return True


def bisect(f, lo, hi, tol):
    while hi - lo > tol:
        mid = (lo + hi) / 2
        lo, hi = (mid, hi) if f(mid) else (lo, mid)
    return lo, hi


def largest_stable_timestep(model, integrator):
    model.opt.integrator = integrator
    if simulate(model, H_MAX):
        return None
    return bisect(lambda h: simulate(model, h), H_MIN, H_MAX, TOL)
