# diagnosis: never calls mujoco.mj_forward
import mujoco
import numpy as np


def rk4_step(model, data):
    h, t = model.opt.timestep, data.time
    q, v, w = data.qpos.copy(), data.qvel.copy(), data.act.copy()

    def f(c, kq, kv, kw):
        qs = q.copy()
        mujoco.mj_integratePos(model, qs, kq, c * h)
        data.qpos[:] = qs
        data.qvel[:] = v + c * h * kv
        data.act[:] = w + c * h * kw
        data.time = t + c * h
        mujoco.mj_kinematics(model, data)
        return data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()

    k1 = f(0, 0 * v, 0 * v, 0 * w)
    k2 = f(0.5, *k1)
    k3 = f(0.5, *k2)
    k4 = f(1, *k3)
    dq, dv, dw = ((a + 2 * b + 2 * c + d) / 6 for a, b, c, d in zip(k1, k2, k3, k4))
    mujoco.mj_integratePos(model, q, dq, h)
    data.qpos[:] = q
    data.qvel[:] = v + h * dv
    data.act[:] = w + h * dw
    data.time = t + h
