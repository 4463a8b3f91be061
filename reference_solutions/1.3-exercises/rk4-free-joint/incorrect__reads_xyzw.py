# diagnosis: The quaternion is read as (x, y, z, w)
import mujoco
import numpy as np


def multiply(a, b):
    """Product of two quaternions (x, y, z, w)."""
    x, y, z, w = a
    X, Y, Z, W = b
    return np.array(
        [w * X + x * W + y * Z - z * Y, w * Y - x * Z + y * W + z * X, w * Z + x * Y - y * X + z * W, w * W - x * X - y * Y - z * Z]
    )


def move(model, qpos, v, h):
    new = qpos.copy()
    mujoco.mj_integratePos(model, new, v, h)
    for kind, i, j in zip(model.jnt_type.tolist(), model.jnt_qposadr.tolist(), model.jnt_dofadr.tolist()):
        if kind < 2:
            i, j = (i + 3, j + 3) if kind == 0 else (i, j)
            angle = np.linalg.norm(v[j : j + 3]) * h
            axis = v[j : j + 3] * h / (angle or 1)
            turn = np.array([*(np.sin(angle / 2) * axis), np.cos(angle / 2)])
            new[i : i + 4] = multiply(qpos[i : i + 4], turn)
    return new


def rk4_step(model, data):
    h, t, q, v = model.opt.timestep, data.time, data.qpos.copy(), data.qvel.copy()

    def f(q, v, t):
        data.qpos[:], data.qvel[:], data.time = q, v, t
        mujoco.mj_forward(model, data)
        return v, data.qacc.copy()

    k1 = f(q, v, t)
    k2 = f(move(model, q, k1[0], h / 2), v + h / 2 * k1[1], t + h / 2)
    k3 = f(move(model, q, k2[0], h / 2), v + h / 2 * k2[1], t + h / 2)
    k4 = f(move(model, q, k3[0], h), v + h * k3[1], t + h)
    dq, dv = ((a + 2 * b + 2 * c + d) / 6 for a, b, c, d in zip(k1, k2, k3, k4))
    data.qpos[:], data.qvel[:], data.time = move(model, q, dq, h), v + h * dv, t + h
