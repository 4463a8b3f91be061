# mistake: Positions are cut to the length of the velocities so that they can be added: quaternions are treated as angles.
# next: Move the positions with mj_integratePos.
# status: incorrect
# told: Your velocities are added to data.qpos number by number
import mujoco
import numpy as np


def moved(model, q, v, h):
    new = q.copy()
    new[: len(v)] += h * v
    return new


def slope(model, data, t, q, v, a):
    data.time = t
    data.qpos[:] = q
    data.qvel[:] = v
    data.act[:] = a
    mujoco.mj_forward(model, data)
    return v.copy(), data.qacc.copy(), data.act_dot.copy()


def rk4_step(model, data):
    h = model.opt.timestep
    t, q, v, a = data.time, data.qpos.copy(), data.qvel.copy(), data.act.copy()
    k1q, k1v, k1a = slope(model, data, t, q, v, a)
    k2q, k2v, k2a = slope(model, data, t + h / 2, moved(model, q, k1q, h / 2), v + h / 2 * k1v, a + h / 2 * k1a)
    k3q, k3v, k3a = slope(model, data, t + h / 2, moved(model, q, k2q, h / 2), v + h / 2 * k2v, a + h / 2 * k2a)
    k4q, k4v, k4a = slope(model, data, t + h, moved(model, q, k3q, h), v + h * k3v, a + h * k3a)
    data.qpos[:] = moved(model, q, (k1q + 2 * k2q + 2 * k3q + k4q) / 6, h)
    data.qvel[:] = v + h * (k1v + 2 * k2v + 2 * k3v + k4v) / 6
    data.act[:] = a + h * (k1a + 2 * k2a + 2 * k3a + k4a) / 6
    data.time = t + h
