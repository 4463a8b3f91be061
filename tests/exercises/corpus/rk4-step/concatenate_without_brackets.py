# mistake: np.concatenate takes one tuple of arrays.
# next: Write np.concatenate((a, b)).
# status: crashed
# told: np.concatenate((a, b))
import mujoco
import numpy as np


def deriv(model, data, y):
    n = model.nq
    data.qpos[:] = y[:n]
    data.qvel[:] = y[n:]
    mujoco.mj_forward(model, data)
    return np.concatenate(data.qvel, data.qacc)


def rk4_step(model, data):
    h = model.opt.timestep
    y = np.concatenate((data.qpos, data.qvel))
    k1 = deriv(model, data, y)
    k2 = deriv(model, data, y + h / 2 * k1)
    k3 = deriv(model, data, y + h / 2 * k2)
    k4 = deriv(model, data, y + h * k3)
    y = y + h * (k1 + 2 * k2 + 2 * k3 + k4) / 6
    data.qpos[:] = y[: model.nq]
    data.qvel[:] = y[model.nq :]
    data.time += h
