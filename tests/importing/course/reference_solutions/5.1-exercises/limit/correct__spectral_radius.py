"""No run at all: linearise one step about the equilibrium and ask when its spectral radius passes 1."""
import mujoco
import numpy as np


def spectral_radius(model, data, h):
    model.opt.timestep = h
    n = model.nq
    columns = []
    for i in range(2 * n):
        ends = []
        for eps in (1e-6, -1e-6):
            mujoco.mj_resetData(model, data)
            x = np.zeros(2 * n)
            x[i] = eps
            data.qpos[:], data.qvel[:] = x[:n], x[n:]
            mujoco.mj_step(model, data)
            ends.append(np.concatenate([data.qpos, data.qvel]))
        columns.append((ends[0] - ends[1]) / 2e-6)
    return np.abs(np.linalg.eigvals(np.array(columns).T)).max()


def largest_stable_timestep(model, integrator):
    model.opt.integrator = integrator
    data = mujoco.MjData(model)
    a, b = 0.001, 0.05
    if spectral_radius(model, data, b) <= 1:
        return None
    for _ in range(12):
        c = (a + b) / 2
        if spectral_radius(model, data, c) <= 1:
            a = c
        else:
            b = c
    return np.array([a, b])
