# diagnosis: The linear velocity of a free joint is in world axes already
# from MuJoCo 4.0.0: incorrect: world axes already
import mujoco
import numpy as np


def rk4_step(model, data):
    h, t, q, v, act = model.opt.timestep, data.time, data.qpos.copy(), data.qvel.copy(), data.act.copy()

    def moved(q, v, h):
        new = q.copy()
        mujoco.mj_integratePos(model, new, v, h)
        for kind, i, j in zip(model.jnt_type.tolist(), model.jnt_qposadr.tolist(), model.jnt_dofadr.tolist()):
            if kind == 0:
                new[i : i + 3] = q[i : i + 3] + h * v[j : j + 3]
        return new

    def f(q, v, act, t):
        data.qpos[:], data.qvel[:], data.act[:], data.time = q, v, act, t
        mujoco.mj_forward(model, data)
        rate = v.copy()
        for kind, i, j in zip(model.jnt_type.tolist(), model.jnt_qposadr.tolist(), model.jnt_dofadr.tolist()):
            if kind == 0:  # from the body's axes into the world's
                mujoco.mju_rotVecQuat(rate[j : j + 3], v[j : j + 3], q[i + 3 : i + 7])
        return rate, data.qacc.copy(), data.act_dot.copy()

    k1 = f(q, v, act, t)
    k2 = f(moved(q, k1[0], h / 2), v + h / 2 * k1[1], act + h / 2 * k1[2], t + h / 2)
    k3 = f(moved(q, k2[0], h / 2), v + h / 2 * k2[1], act + h / 2 * k2[2], t + h / 2)
    k4 = f(moved(q, k3[0], h), v + h * k3[1], act + h * k3[2], t + h)
    dq, dv, dact = ((a + 2 * b + 2 * c + d) / 6 for a, b, c, d in zip(k1, k2, k3, k4))
    data.qpos[:], data.qvel[:], data.act[:], data.time = moved(q, dq, h), v + h * dv, act + h * dact, t + h
