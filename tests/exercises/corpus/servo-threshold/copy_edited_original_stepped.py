# mistake: Timestep and integrator are set on a copy of the model, but the original is stepped.
# next: Step the model on which the options were set.
# status: incorrect
# told: Your only run used a timestep of 2 ms: the model that you step is not one whose timestep
import copy

import mujoco


def is_stable(model, integrator, h):
    m = copy.copy(model)  # do not edit the caller's model
    m.opt.integrator = integrator
    m.opt.timestep = h
    d = mujoco.MjData(m)
    d.qpos[0] = 1.0
    for _ in range(round(3.0 / h)):
        mujoco.mj_step(model, d)
        if d.warning[mujoco.mjtWarning.mjWARN_BADQACC].number > 0:
            return False
    return True


def largest_stable_timestep(model, integrator):
    lo, hi = 0.001, 0.05
    if is_stable(model, integrator, hi):
        return None
    while hi - lo > 0.0005:
        mid = (lo + hi) / 2
        if is_stable(model, integrator, mid):
            lo = mid
        else:
            hi = mid
    return lo, hi
