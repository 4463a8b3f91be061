# mistake: The state passes through an array of 32-bit floats, which rounds to seven digits at each step.
# next: Keep the state in float64.
# status: incorrect
# told: The state went through 32-bit floats
import mujoco
import numpy as np


def rk4_step(model, data):
    h = model.opt.timestep
    n = model.nq
    # state vector [q, v, act]
    y0 = np.zeros(model.nq + model.nv + model.na, dtype=np.float32)
    y0[:n] = data.qpos
    y0[n:2 * n] = data.qvel
    y0[2 * n:] = data.act
    t0 = data.time

    def fun(t, y):
        data.time = t
        data.qpos[:] = y[:n]
        data.qvel[:] = y[n:2 * n]
        data.act[:] = y[2 * n:]
        mujoco.mj_forward(model, data)
        return np.concatenate([data.qvel, data.qacc, data.act_dot])

    k1 = fun(t0, y0)
    k2 = fun(t0 + h / 2, y0 + h / 2 * k1)
    k3 = fun(t0 + h / 2, y0 + h / 2 * k2)
    k4 = fun(t0 + h, y0 + h * k3)
    y = y0 + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    data.qpos[:] = y[:n]
    data.qvel[:] = y[n:2 * n]
    data.act[:] = y[2 * n:]
    data.time = t0 + h
