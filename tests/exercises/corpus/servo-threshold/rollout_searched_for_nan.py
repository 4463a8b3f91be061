# mistake: The states of mujoco.rollout are searched for nan, but MuJoCo resets before a nan is ever written.
# next: Look for time running backwards, or at data.warning.
# status: incorrect
# told: Your runs are those of mujoco.rollout, and you found nothing unstable
import mujoco
import mujoco.rollout
import numpy as np


def diverged(model, h):
    model.opt.timestep = h
    data = mujoco.MjData(model)
    data.qpos[0] = 1.0
    full = mujoco.mjtState.mjSTATE_FULLPHYSICS
    x0 = np.empty(mujoco.mj_stateSize(model, full))
    mujoco.mj_getState(model, data, x0, full)
    states, _ = mujoco.rollout.rollout(model, data, x0[None, :], nstep=int(np.ceil(3.0 / h)))
    return not np.isfinite(states).all()


def largest_stable_timestep(model, integrator):
    model.opt.integrator = integrator
    lo, hi = 0.001, 0.05
    if not diverged(model, hi):
        return None
    while hi - lo > 5e-4:
        mid = (lo + hi) / 2
        if diverged(model, mid):
            hi = mid
        else:
            lo = mid
    return lo, hi
