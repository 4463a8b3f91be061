# mistake: The scalar part of the quaternion is made positive by flipping only w, which is another rotation.
# next: Turn all four signs, or none.
# status: partial
# told: Your step changes the sign of a quaternion's w and leaves x, y and z as they are: that is
import mujoco
import numpy as np


def qdot(model, q, v):
    """Derivative of qpos: quaternions by Q' = 1/2 Q (0, w), w in body axes."""
    out = np.zeros(model.nq)
    for j in range(model.njnt):
        i, k, typ = model.jnt_qposadr[j], model.jnt_dofadr[j], model.jnt_type[j]
        if typ == 0:
            out[i:i + 3] = v[k:k + 3]
            i, k = i + 3, k + 3
        if typ <= 1:
            w, x, y, z = q[i:i + 4]
            p = v[k:k + 3]
            out[i:i + 4] = 0.5 * np.array([
                -x * p[0] - y * p[1] - z * p[2],
                w * p[0] + y * p[2] - z * p[1],
                w * p[1] - x * p[2] + z * p[0],
                w * p[2] + x * p[1] - y * p[0]])
        else:
            out[i] = v[k]
    return out


def normalise(model, q):
    for j in range(model.njnt):
        i, typ = model.jnt_qposadr[j], model.jnt_type[j]
        if typ <= 1:
            i += 3 if typ == 0 else 0
            q[i:i + 4] /= np.linalg.norm(q[i:i + 4])


def rk4_step(model, data):
    h = model.opt.timestep
    q0, v0, a0, t0 = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.time

    def slope(q, v, a, t):
        data.qpos[:] = q
        data.qvel[:] = v
        data.act[:] = a
        data.time = t
        mujoco.mj_forward(model, data)
        return qdot(model, q, v), data.qacc.copy(), data.act_dot.copy()

    k1 = slope(q0, v0, a0, t0)
    k2 = slope(q0 + h / 2 * k1[0], v0 + h / 2 * k1[1], a0 + h / 2 * k1[2], t0 + h / 2)
    k3 = slope(q0 + h / 2 * k2[0], v0 + h / 2 * k2[1], a0 + h / 2 * k2[2], t0 + h / 2)
    k4 = slope(q0 + h * k3[0], v0 + h * k3[1], a0 + h * k3[2], t0 + h)
    q, v, a = (s + h * (p + 2 * r + 2 * u + w) / 6
               for s, p, r, u, w in zip((q0, v0, a0), k1, k2, k3, k4))
    normalise(model, q)
    for j in range(model.njnt):
        i = model.jnt_qposadr[j] + (3 if model.jnt_type[j] == 0 else 0)
        if model.jnt_type[j] <= 1:
            q[i] = abs(q[i])
    data.qpos[:] = q
    data.qvel[:] = v
    data.act[:] = a
    data.time = t0 + h
