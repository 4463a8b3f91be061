# diagnosis: ball joint
import mujoco
import numpy as np


def rk4_step(model, data):
    """Knows that a free joint comes first: three positions, then one quaternion."""
    h, t, q, v = model.opt.timestep, data.time, data.qpos.copy(), data.qvel.copy()

    def f(q, v, t):
        data.qpos[:], data.qvel[:], data.time = q, v, t
        mujoco.mj_forward(model, data)
        rate = np.zeros(model.nq)
        rate[:3] = v[:3]
        if model.nv >= 6:
            mujoco.mju_mulQuat(rate[3:7], q[3:7], np.concatenate([[0], v[3:6]]) / 2)
        return rate, data.qacc.copy()

    k1 = f(q, v, t)
    k2 = f(q + h / 2 * k1[0], v + h / 2 * k1[1], t + h / 2)
    k3 = f(q + h / 2 * k2[0], v + h / 2 * k2[1], t + h / 2)
    k4 = f(q + h * k3[0], v + h * k3[1], t + h)
    dq, dv = ((a + 2 * b + 2 * c + d) / 6 for a, b, c, d in zip(k1, k2, k3, k4))
    data.qpos[:], data.qvel[:], data.time = q + h * dq, v + h * dv, t + h
