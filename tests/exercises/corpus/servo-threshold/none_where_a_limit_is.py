# mistake: None is returned for implicitfast without a measurement, as if implicit meant stable everywhere.
# next: Measure implicitfast as well: its spring is explicit.
# status: partial
# told: Under implicitfast your function returned None without a single step
import mujoco


def blows_up(model, integrator, h):
    model.opt.integrator, model.opt.timestep = integrator, h
    d = mujoco.MjData(model)
    d.qpos[0] = 1.0
    for _ in range(round(3 / h)):
        t = d.time
        mujoco.mj_step(model, d)
        if d.time < t:
            return True
    return False


def largest_stable_timestep(model, integrator):
    # implicit integrators are unconditionally stable -> only Euler has a limit
    if integrator != mujoco.mjtIntegrator.mjINT_EULER:
        return None
    lo, hi = 0.001, 0.05
    if not blows_up(model, integrator, hi):
        return None
    while hi - lo > 0.0005:
        mid = (lo + hi) / 2
        if blows_up(model, integrator, mid):
            hi = mid
        else:
            lo = mid
    return lo, hi
