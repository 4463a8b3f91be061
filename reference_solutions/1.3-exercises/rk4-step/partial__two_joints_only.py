# diagnosis: Some velocities do not change
import mujoco
import numpy as np


def rk4_step(model, data):
    """For the double pendulum: y holds its two angles and two velocities."""
    h, t0 = model.opt.timestep, data.time
    y0, act0 = np.array([*data.qpos[:2], *data.qvel[:2]]), data.act.copy()

    def put(y, act, t):
        data.qpos[:2], data.qvel[:2], data.act[:], data.time = y[:2], y[2:], act, t

    def slope(y, act, t):
        put(y, act, t)
        mujoco.mj_forward(model, data)
        return np.array([*y[2:], *data.qacc[:2]]), data.act_dot.copy()

    k1, a1 = slope(y0, act0, t0)
    k2, a2 = slope(y0 + h / 2 * k1, act0 + h / 2 * a1, t0 + h / 2)
    k3, a3 = slope(y0 + h / 2 * k2, act0 + h / 2 * a2, t0 + h / 2)
    k4, a4 = slope(y0 + h * k3, act0 + h * a3, t0 + h)
    put(y0 + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4), act0 + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4), t0 + h)
