# diagnosis: The weighted sum went through 16-bit
import mujoco
import numpy as np


def f(model, data, t, q, v, w):
    data.time = t
    data.qpos[:] = q
    data.qvel[:] = v
    data.act[:] = w
    mujoco.mj_forward(model, data)
    return data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()


def rk4_step(model, data):
    h, t = model.opt.timestep, data.time
    q, v, w = data.qpos.copy(), data.qvel.copy(), data.act.copy()
    k1q, k1v, k1w = f(model, data, t, q, v, w)
    k2q, k2v, k2w = f(model, data, t + h / 2, q + h / 2 * k1q, v + h / 2 * k1v, w + h / 2 * k1w)
    k3q, k3v, k3w = f(model, data, t + h / 2, q + h / 2 * k2q, v + h / 2 * k2v, w + h / 2 * k2w)
    k4q, k4v, k4w = f(model, data, t + h, q + h * k3q, v + h * k3v, w + h * k3w)
    data.qpos[:] = q + h / 6 * (k1q + 2 * k2q + 2 * k3q + k4q).astype(np.float16)
    data.qvel[:] = v + h / 6 * (k1v + 2 * k2v + 2 * k3v + k4v).astype(np.float16)
    data.act[:] = w + h / 6 * (k1w + 2 * k2w + 2 * k3w + k4w)
    data.time = t + h
