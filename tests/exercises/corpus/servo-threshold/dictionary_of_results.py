# mistake: It returns a dictionary of results instead of the pair (h_stable, h_unstable).
# next: Return (low, high).
# status: incorrect
# told: Your function returns a value of type dict
import mujoco

NAMES = {0: "Euler", 3: "implicitfast", 4: "discrete"}


def stable(model, h):
    model.opt.timestep = h
    data = mujoco.MjData(model)
    data.qpos[0] = 1.0
    for _ in range(round(3 / h)):
        mujoco.mj_step(model, data)
        if data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number:
            return False
    return True


def largest_stable_timestep(model, integrator):
    model.opt.integrator = integrator
    lo, hi = 0.001, 0.05
    if stable(model, hi):
        return {"integrator": NAMES[integrator], "limit": None}
    while hi - lo > 0.0005:
        mid = (lo + hi) / 2
        if stable(model, mid):
            lo = mid
        else:
            hi = mid
    return {"integrator": NAMES[integrator], "limit": (lo, hi)}
