# mistake: The factor 1/2 is missing in the quaternion's derivative, so bodies turn twice as fast.
# next: Use Q' = 1/2 Q (0, omega).
# status: incorrect
# told: The quaternion turns twice as fast as it should: its derivative is quat
import mujoco
import numpy as np


def position_rate(model, q, v):
    """dq/dt, same length as qpos"""
    dq = np.empty_like(q)
    for j in range(model.njnt):
        qa = model.jnt_qposadr[j]
        va = model.jnt_dofadr[j]
        jtype = model.jnt_type[j]
        if jtype == 0:  # free
            dq[qa:qa + 3] = v[va:va + 3]
            qa += 3
            va += 3
        if jtype in (0, 1):  # free or ball
            res = np.zeros(4)
            mujoco.mju_mulQuat(res, q[qa:qa + 4], np.concatenate(([0.0], v[va:va + 3])))
            dq[qa:qa + 4] = res
        else:
            dq[qa] = v[va]
    return dq


def normalise(model, q):
    mujoco.mj_normalizeQuat(model, q)
    return q


def rk4_step(model, data):
    h = model.opt.timestep
    q0, v0, a0, t0 = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.time
    K = []
    for c in (0.0, 0.5, 0.5, 1.0):
        kq, kv, ka = K[-1] if K else (0 * q0, 0 * v0, 0 * a0)
        q, v, a = q0 + c * h * kq, v0 + c * h * kv, a0 + c * h * ka
        data.qpos[:], data.qvel[:], data.act[:], data.time = q, v, a, t0 + c * h
        mujoco.mj_forward(model, data)
        K.append((position_rate(model, q, v), data.qacc.copy(), data.act_dot.copy()))
    weighted = [(K[0][i] + 2 * K[1][i] + 2 * K[2][i] + K[3][i]) * h / 6 for i in range(3)]
    data.qpos[:] = normalise(model, q0 + weighted[0])
    data.qvel[:] = v0 + weighted[1]
    data.act[:] = a0 + weighted[2]
    data.time = t0 + h
