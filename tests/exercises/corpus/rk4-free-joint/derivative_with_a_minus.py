# mistake: The quaternion's derivative has a minus sign, so that the body turns the other way.
# next: Take away the minus.
# status: incorrect
# told: Your quaternion turns backwards: its derivative is quat * (0, omega) / 2, with a plus
import mujoco
import numpy as np

LINEAR = {int(mujoco.mjtJoint.mjJNT_FREE): 3, int(mujoco.mjtJoint.mjJNT_BALL): 0}


def walk_joints(model):
    for kind, q, v in zip(model.jnt_type.tolist(), model.jnt_qposadr.tolist(), model.jnt_dofadr.tolist()):
        n = LINEAR.get(kind, 1)
        yield slice(q, q + n), slice(v, v + n), slice(q + n, q + n + 4 * (kind in LINEAR)), slice(v + n, v + n + 3)


def unit(model, q):
    q = q.copy()
    mujoco.mj_normalizeQuat(model, q)
    return q


def rate_of(model, q, v):
    rate = np.zeros(model.nq)
    for at, speed, quat, omega in walk_joints(model):
        rate[at] = v[speed]
        if quat.start != quat.stop:
            product = np.zeros(4)
            mujoco.mju_mulQuat(product, q[quat], np.concatenate([[0], v[omega]]))
            rate[quat] = -product / 2
    return rate


def rk4_step(model, data):
    h, t, start = model.opt.timestep, data.time, (data.qpos.copy(), data.qvel.copy(), data.act.copy())

    def slopes(y, t):
        data.qpos[:], data.qvel[:], data.act[:], data.time = unit(model, y[0]), y[1], y[2], t
        mujoco.mj_forward(model, data)
        return rate_of(model, y[0], y[1]), data.qacc.copy(), data.act_dot.copy()

    def move(k, s):
        return tuple(a + s * b for a, b in zip(start, k))

    k1 = slopes(start, t)
    k2 = slopes(move(k1, h / 2), t + h / 2)
    k3 = slopes(move(k2, h / 2), t + h / 2)
    k4 = slopes(move(k3, h), t + h)
    q, v, act = move([(a + 2 * b + 2 * c + d) / 6 for a, b, c, d in zip(k1, k2, k3, k4)], h)
    data.qpos[:], data.qvel[:], data.act[:], data.time = unit(model, q), v, act, t + h
