# mistake: `x = y` and `x += ...` change the saved start y itself, because += works in place on arrays.
# next: Write x = y + h/2 * k, which makes a new array.
# status: incorrect
# told: because y += ... changes y itself
import mujoco
import numpy as np


def f(model, data, y, t):
    nv = model.nv
    data.qpos[:] = y[:nv]
    data.qvel[:] = y[nv : 2 * nv]
    data.act[:] = y[2 * nv :]
    data.time = t
    mujoco.mj_forward(model, data)
    return np.concatenate([data.qvel, data.qacc, data.act_dot])


def rk4_step(model, data):
    h = model.opt.timestep
    t = data.time
    y = np.concatenate([data.qpos, data.qvel, data.act])

    k1 = f(model, data, y, t)
    y2 = y
    y2 += h / 2 * k1
    k2 = f(model, data, y2, t + h / 2)
    y3 = y
    y3 += h / 2 * k2
    k3 = f(model, data, y3, t + h / 2)
    y4 = y
    y4 += h * k3
    k4 = f(model, data, y4, t + h)

    y += h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    data.qpos[:] = y[: model.nv]
    data.qvel[:] = y[model.nv : 2 * model.nv]
    data.act[:] = y[2 * model.nv :]
    data.time = t + h
