# mistake: It looks for NaN in the state at the end of the run, but MuJoCo has reset the state long before, so no run looks unstable.
# next: Read data.warning[...].number, or watch for data.time running backwards.
# status: incorrect
# told: At 50 ms MuJoCo raised BADQACC and reset the state, and your answer calls that timestep
import mujoco
import numpy as np


def simulate(model, integrator, h):
    model.opt.integrator = integrator
    model.opt.timestep = h
    data = mujoco.MjData(model)
    data.qpos[0] = 1.0
    qs = []
    for _ in range(round(3 / h)):
        mujoco.mj_step(model, data)
    qs.append(data.qpos[0])
    return np.array(qs)


def largest_stable_timestep(model, integrator):
    lo, hi = 0.001, 0.05
    stable = lambda h: bool(np.all(np.isfinite(simulate(model, integrator, h))))
    if stable(hi):
        return None
    while hi - lo > 0.0005:
        mid = (lo + hi) / 2
        if stable(mid):
            lo = mid
        else:
            hi = mid
    return lo, hi
