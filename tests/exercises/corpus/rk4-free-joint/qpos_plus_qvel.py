# mistake: qpos and qvel are added, although qpos is longer than qvel where there are quaternions.
# next: Move positions with mujoco.mj_integratePos.
# status: crashed
# told: ValueError: operands could not be
import mujoco
import numpy as np


def axpy(y, dt, k):
    """y + dt*k for the three parts of the state"""
    return [yi + dt * ki for yi, ki in zip(y, k)]


def slope(model, data, y, t):
    data.qpos[:] = y[0]
    data.qvel[:] = y[1]
    data.act[:] = y[2]
    data.time = t
    mujoco.mj_forward(model, data)
    return [data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()]


def rk4_step(model, data):
    h = model.opt.timestep
    t = data.time
    y = [data.qpos.copy(), data.qvel.copy(), data.act.copy()]
    k1 = slope(model, data, y, t)
    k2 = slope(model, data, axpy(y, h / 2, k1), t + h / 2)
    k3 = slope(model, data, axpy(y, h / 2, k2), t + h / 2)
    k4 = slope(model, data, axpy(y, h, k3), t + h)
    for w, k in zip((1, 2, 2, 1), (k1, k2, k3, k4)):
        y = axpy(y, w * h / 6, k)
    data.qpos[:], data.qvel[:], data.act[:] = y
    data.time = t + h
