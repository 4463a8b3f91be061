"""Fehlberg's fourth-order formula, whose error shrinks a little faster at large timesteps."""
import mujoco
import numpy as np

FREE, BALL = int(mujoco.mjtJoint.mjJNT_FREE), int(mujoco.mjtJoint.mjJNT_BALL)
STAGES = (
    (),
    (1 / 4,),
    (3 / 32, 9 / 32),
    (1932 / 2197, -7200 / 2197, 7296 / 2197),
    (439 / 216, -8, 3680 / 513, -845 / 4104),
)
WEIGHTS = (25 / 216, 0, 1408 / 2565, 2197 / 4104, -1 / 5)


def qpos_rate(model, q, v):
    rate = np.zeros(model.nq)
    for kind, i, j in zip(model.jnt_type.tolist(), model.jnt_qposadr.tolist(), model.jnt_dofadr.tolist()):
        plain = {FREE: 3, BALL: 0}.get(kind, 1)
        rate[i : i + plain] = v[j : j + plain]
        if kind in (FREE, BALL):
            quat, spin = slice(i + plain, i + plain + 4), v[j + plain : j + plain + 3]
            mujoco.mju_mulQuat(rate[quat], q[quat], np.array([0, *spin]) / 2)
    return rate


def rk4_step(model, data):
    h, t = model.opt.timestep, data.time
    state = np.concatenate([data.qpos, data.qvel, data.act])
    ends = [model.nq, model.nq + model.nv]
    slopes = []

    def put(weights, part):
        now = state + h * sum((w * k for w, k in zip(weights, slopes)), np.zeros(state.size))
        data.qpos[:], data.qvel[:], data.act[:] = np.split(now, ends)
        data.time = t + part * h

    for row in STAGES:
        put(row, sum(row))
        mujoco.mj_forward(model, data)
        slopes.append(np.concatenate([qpos_rate(model, data.qpos, data.qvel), data.qacc, data.act_dot]))
    put(WEIGHTS, 1)
    mujoco.mj_normalizeQuat(model, data.qpos)
