# mistake: The helper writes the state but mj_forward is called with another MjData that it made.
# next: Call mj_forward with the data whose state was written.
# status: incorrect
# told: Every call of mj_forward finds the same state
import mujoco
import numpy as np


def f(model, data, other, t, q, v, a):
    data.time = t
    data.qpos[:] = q
    data.qvel[:] = v
    data.act[:] = a
    mujoco.mj_forward(model, other)
    return v.copy(), other.qacc.copy(), data.act_dot.copy()


def rk4_step(model, data):
    h = model.opt.timestep
    other = mujoco.MjData(model)
    t, q, v, a = data.time, data.qpos.copy(), data.qvel.copy(), data.act.copy()
    k1q, k1v, k1a = f(model, data, other, t, q, v, a)
    k2q, k2v, k2a = f(model, data, other, t + h / 2, q + h / 2 * k1q, v + h / 2 * k1v, a + h / 2 * k1a)
    k3q, k3v, k3a = f(model, data, other, t + h / 2, q + h / 2 * k2q, v + h / 2 * k2v, a + h / 2 * k2a)
    k4q, k4v, k4a = f(model, data, other, t + h, q + h * k3q, v + h * k3v, a + h * k3a)
    data.qpos[:] = q + h / 6 * (k1q + 2 * k2q + 2 * k3q + k4q)
    data.qvel[:] = v + h / 6 * (k1v + 2 * k2v + 2 * k3v + k4v)
    data.act[:] = a + h / 6 * (k1a + 2 * k2a + 2 * k3a + k4a)
    data.time = t + h
