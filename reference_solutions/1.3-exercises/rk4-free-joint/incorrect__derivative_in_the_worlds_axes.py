# diagnosis: as if the angular velocity were given in the world
import mujoco
import numpy as np

OFFSET = {int(mujoco.mjtJoint.mjJNT_FREE): 3, int(mujoco.mjtJoint.mjJNT_BALL): 0}


def qpos_rate(model, q, v):
    rate = np.zeros(model.nq)
    for kind, i, j in zip(model.jnt_type.tolist(), model.jnt_qposadr.tolist(), model.jnt_dofadr.tolist()):
        n = OFFSET.get(kind, 1)
        rate[i : i + n] = v[j : j + n]
        if kind in OFFSET:
            mujoco.mju_derivQuat(rate[i + n : i + n + 4], q[i + n : i + n + 4], v[j + n : j + n + 3])
    return rate


def rk4_step(model, data):
    h, t, q, v, act = model.opt.timestep, data.time, data.qpos.copy(), data.qvel.copy(), data.act.copy()

    def f(q, v, act, t):
        data.qpos[:], data.qvel[:], data.act[:], data.time = q, v, act, t
        mujoco.mj_forward(model, data)
        return qpos_rate(model, q, v), data.qacc.copy(), data.act_dot.copy()

    k1 = f(q, v, act, t)
    k2 = f(q + h / 2 * k1[0], v + h / 2 * k1[1], act + h / 2 * k1[2], t + h / 2)
    k3 = f(q + h / 2 * k2[0], v + h / 2 * k2[1], act + h / 2 * k2[2], t + h / 2)
    k4 = f(q + h * k3[0], v + h * k3[1], act + h * k3[2], t + h)
    dq, dv, dact = ((a + 2 * b + 2 * c + d) / 6 for a, b, c, d in zip(k1, k2, k3, k4))
    data.qpos[:], data.qvel[:], data.act[:], data.time = q + h * dq, v + h * dv, act + h * dact, t + h
    mujoco.mj_normalizeQuat(model, data.qpos)
