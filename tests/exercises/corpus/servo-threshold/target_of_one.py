# mistake: data.ctrl is set to 1 as well, so the servo's target is the start and the run begins at rest near its equilibrium.
# next: Leave data.ctrl at 0.
# status: partial
# told: Your runs set data.ctrl[0] to 1, which is the servo's target; it should stay 0, so that
import mujoco


def stable(model, integrator, h):
    model.opt.integrator, model.opt.timestep = integrator, h
    data = mujoco.MjData(model)
    data.qpos[0] = 1.0
    data.ctrl[0] = 1.0
    prev = 0.0
    for _ in range(round(3 / h)):
        mujoco.mj_step(model, data)
        if data.time < prev:
            return False
        prev = data.time
    return True


def largest_stable_timestep(model, integrator):
    if stable(model, integrator, 0.05):
        return None
    lo, hi = 0.001, 0.05
    while hi - lo > 0.0005:
        mid = (lo + hi) / 2
        if stable(model, integrator, mid):
            lo = mid
        else:
            hi = mid
    return lo, hi
