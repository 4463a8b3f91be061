# mistake: The scan goes from 50 ms downwards and stops at the first unstable timestep, which is 50 ms itself.
# next: When you scan downwards, stop at the first stable timestep.
# status: incorrect
# told: as stable, but never ran it. Return the last timesteps
import mujoco
import numpy as np


def stable(model, integrator, h):
    model.opt.integrator = integrator
    model.opt.timestep = h
    d = mujoco.MjData(model)
    d.qpos[0] = 1.0
    mujoco.mj_step(model, d, nstep=int(3 / h))
    return all(d.warning[i].number == 0 for i in range(len(d.warning)))


def largest_stable_timestep(model, integrator):
    for h in np.arange(0.05, 0.001, -0.0004):
        if not stable(model, integrator, h):
            return h - 0.0004, h
    return None
