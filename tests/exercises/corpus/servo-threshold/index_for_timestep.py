# mistake: It returns the indices of the two timesteps in its list, not the timesteps.
# next: Return timesteps[i - 1] and timesteps[i].
# status: incorrect
# told: Return the timesteps themselves, not their places in a list
import mujoco
import numpy as np


def unstable(model, integrator, h):
    model.opt.integrator, model.opt.timestep = integrator, h
    data = mujoco.MjData(model)
    data.qpos[:] = 1
    for _ in range(int(np.ceil(3 / h))):
        mujoco.mj_step(model, data)
    return sum(w.number for w in data.warning) > 0


def largest_stable_timestep(model, integrator):
    timesteps = np.linspace(0.01, 0.05, 90)
    for i, h in enumerate(timesteps):
        if unstable(model, integrator, h):
            return i - 1, i
    return None
