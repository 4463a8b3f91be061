"""Any autoreset shows as time running backwards; 20 s per run, bracket of 0.1 ms."""
import mujoco


def blows_up(model, data, h, seconds=20.0):
    model.opt.timestep = h
    mujoco.mj_resetData(model, data)
    data.qpos[0] = 1.0
    for _ in range(round(seconds / h)):
        before = data.time
        mujoco.mj_step(model, data)
        if data.time < before:
            return True
    return False


def largest_stable_timestep(model, integrator):
    model.opt.integrator = integrator
    data = mujoco.MjData(model)
    lo, hi = 1e-3, 50e-3
    if not blows_up(model, data, hi):
        return None
    while hi - lo > 1e-4:
        mid = 0.5 * (lo + hi)
        lo, hi = (lo, mid) if blows_up(model, data, mid) else (mid, hi)
    return lo, hi
