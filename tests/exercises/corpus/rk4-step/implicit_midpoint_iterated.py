# mistake: This is the implicit midpoint rule with three iterations: the step takes the last slope alone, and is of second order.
# next: Weigh all four slopes with 1, 2, 2, 1 over 6.
# status: incorrect
# told: This is the implicit midpoint rule
import mujoco
import numpy as np


def rk4_step(model, data):
    h = model.opt.timestep
    q0 = np.array(data.qpos)
    v0 = np.array(data.qvel)
    w0 = np.array(data.act)
    t0 = data.time
    mujoco.mj_forward(model, data)
    kq, kv, kw = v0, np.array(data.qacc), np.array(data.act_dot)
    for iteration in range(3):
        data.qpos[:] = q0 + h / 2 * kq
        data.qvel[:] = v0 + h / 2 * kv
        data.act[:] = w0 + h / 2 * kw
        data.time = t0 + h / 2
        mujoco.mj_forward(model, data)
        kq, kv, kw = np.array(data.qvel), np.array(data.qacc), np.array(data.act_dot)
    data.qpos[:] = q0 + h * kq
    data.qvel[:] = v0 + h * kv
    data.act[:] = w0 + h * kw
    data.time = t0 + h
