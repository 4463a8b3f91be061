# from MuJoCo 4.0.0: partial: of second order on rotations only
"""MuJoCo's own method on a single free body, the quaternion's derivative elsewhere: either is right."""
import mujoco
import numpy as np

OFFSET = {int(mujoco.mjtJoint.mjJNT_FREE): 3, int(mujoco.mjtJoint.mjJNT_BALL): 0}


def qpos_rate(model, q, v):
    rate = np.zeros(model.nq)
    for kind, i, j in zip(model.jnt_type.tolist(), model.jnt_qposadr.tolist(), model.jnt_dofadr.tolist()):
        n = OFFSET.get(kind, 1)
        rate[i : i + n] = v[j : j + n]
        if kind in OFFSET:
            w = np.concatenate([[0], v[j + n : j + n + 3]])
            mujoco.mju_mulQuat(rate[i + n : i + n + 4], q[i + n : i + n + 4], w / 2)
    return rate


def rk4_step(model, data):
    (as_mujoco if model.njnt == 1 and model.nq == 7 else by_derivative)(model, data)


def by_derivative(model, data):
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


def mean(k):
    return (k[0] + 2 * k[1] + 2 * k[2] + k[3]) / 6


def as_mujoco(model, data):
    h, t0 = model.opt.timestep, data.time
    q0, v0, act0 = data.qpos.copy(), data.qvel.copy(), data.act.copy()
    vs, accs, rates = [], [], []
    for fraction in (0, 0.5, 0.5, 1):
        data.qpos[:], data.qvel[:], data.act[:] = q0, v0, act0
        if vs:
            mujoco.mj_integratePos(model, data.qpos, vs[-1], fraction * h)
            data.qvel[:] = v0 + fraction * h * accs[-1]
            data.act[:] = act0 + fraction * h * rates[-1]
        data.time = t0 + fraction * h
        mujoco.mj_forward(model, data)
        vs.append(data.qvel.copy())
        accs.append(data.qacc.copy())
        rates.append(data.act_dot.copy())
    data.qpos[:] = q0
    mujoco.mj_integratePos(model, data.qpos, mean(vs), h)
    data.qvel[:] = v0 + h * mean(accs)
    data.act[:] = act0 + h * mean(rates)
    data.time = t0 + h
