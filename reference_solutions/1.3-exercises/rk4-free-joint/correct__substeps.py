"""Four substeps of the formula of Dormand and Prince: so near to the motion that no order shows."""
import mujoco
import numpy as np

FREE, BALL = int(mujoco.mjtJoint.mjJNT_FREE), int(mujoco.mjtJoint.mjJNT_BALL)
STAGES = (
    (),
    (1 / 5,),
    (3 / 40, 9 / 40),
    (44 / 45, -56 / 15, 32 / 9),
    (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
    (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
)
WEIGHTS = (35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84)


def qpos_rate(model, q, v):
    rate = np.zeros(model.nq)
    for kind, i, j in zip(model.jnt_type.tolist(), model.jnt_qposadr.tolist(), model.jnt_dofadr.tolist()):
        plain = {FREE: 3, BALL: 0}.get(kind, 1)
        rate[i : i + plain] = v[j : j + plain]
        if kind in (FREE, BALL):
            quat, spin = slice(i + plain, i + plain + 4), v[j + plain : j + plain + 3]
            mujoco.mju_mulQuat(rate[quat], q[quat], np.array([0, *spin]) / 2)
    return rate


SUBSTEPS = 4


def rk4_step(model, data):
    for _ in range(SUBSTEPS):
        substep(model, data, model.opt.timestep / SUBSTEPS)


def substep(model, data, h):
    t = data.time
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
