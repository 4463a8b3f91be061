# mistake: One sign in the matrix of the quaternion's rate is wrong (third row).
# next: Compare the matrix with Q (0, w) / 2, row by row.
# status: incorrect
# told: One sign in your quaternion's derivative is wrong: in the number y of the result
import mujoco
import numpy as np


def Omega(w):
    x, y, z = w
    return np.array([[0, -x, -y, -z], [x, 0, z, -y], [y, z, 0, x], [z, y, -x, 0]])


def position_rate(model, q, v):
    out = []
    for j in range(model.njnt):
        a = model.jnt_qposadr[j]
        d = model.jnt_dofadr[j]
        if model.jnt_type[j] == mujoco.mjtJoint.mjJNT_FREE:
            out.extend(v[d : d + 3])
            out.extend(0.5 * Omega(v[d + 3 : d + 6]) @ q[a + 3 : a + 7])
        elif model.jnt_type[j] == mujoco.mjtJoint.mjJNT_BALL:
            out.extend(0.5 * Omega(v[d : d + 3]) @ q[a : a + 4])
        else:
            out.append(v[d])
    return np.array(out)


def rk4_step(model, data):
    h = model.opt.timestep
    nq, nv = model.nq, model.nv
    y = np.concatenate([data.qpos, data.qvel, data.act])
    t = data.time

    def put(y):
        data.qpos[:], data.qvel[:], data.act[:] = y[:nq], y[nq : nq + nv], y[nq + nv :]
        mujoco.mj_normalizeQuat(model, data.qpos)

    def f(y, t):
        put(y)
        data.time = t
        mujoco.mj_forward(model, data)
        return np.concatenate([position_rate(model, data.qpos, data.qvel), data.qacc, data.act_dot])

    k1 = f(y, t)
    k2 = f(y + h / 2 * k1, t + h / 2)
    k3 = f(y + h / 2 * k2, t + h / 2)
    k4 = f(y + h * k3, t + h)
    put(y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4))
    data.time = t + h
