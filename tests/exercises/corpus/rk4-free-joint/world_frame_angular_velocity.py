# mistake: The quaternion is turned from the left, as if the angular velocity in qvel were in world axes; it is in the body's axes.
# next: Multiply from the right: Q times (0, omega) over 2.
# status: incorrect
# told: Your quaternion turns as if the angular velocity were given in the world's axes; it is in
import mujoco
import numpy as np


def qmul(a, b):
    w1, x1, y1, z1 = a
    w2, x2, y2, z2 = b
    return np.array([
        w1 * w2 - x1 * x2 - y1 * y2 - z1 * z2,
        w1 * x2 + x1 * w2 + y1 * z2 - z1 * y2,
        w1 * y2 - x1 * z2 + y1 * w2 + z1 * x2,
        w1 * z2 + x1 * y2 - y1 * x2 + z1 * w2,
    ])


def quaternion_rows(model):
    rows = []
    for j in range(model.njnt):
        q, d = model.jnt_qposadr[j], model.jnt_dofadr[j]
        if model.jnt_type[j] == int(mujoco.mjtJoint.mjJNT_FREE):
            rows.append((q + 3, d + 3))
        elif model.jnt_type[j] == int(mujoco.mjtJoint.mjJNT_BALL):
            rows.append((q, d))
    return rows


def qdot(model, q, v):
    out = np.zeros(model.nq)
    for j in range(model.njnt):
        a, d = model.jnt_qposadr[j], model.jnt_dofadr[j]
        kind = model.jnt_type[j]
        if kind == int(mujoco.mjtJoint.mjJNT_FREE):
            out[a:a + 3] = v[d:d + 3]
        elif kind != int(mujoco.mjtJoint.mjJNT_BALL):
            out[a] = v[d]
    for a, d in quaternion_rows(model):
        out[a:a + 4] = 0.5 * qmul(np.r_[0, v[d:d + 3]], q[a:a + 4])
    return out


def rk4_step(model, data):
    h, t = model.opt.timestep, data.time
    q, v, u = data.qpos.copy(), data.qvel.copy(), data.act.copy()

    def f(q_, v_, u_, t_):
        data.qpos[:] = q_
        data.qvel[:] = v_
        data.act[:] = u_
        data.time = t_
        mujoco.mj_forward(model, data)
        return qdot(model, q_, v_), data.qacc.copy(), data.act_dot.copy()

    k1 = f(q, v, u, t)
    k2 = f(q + h / 2 * k1[0], v + h / 2 * k1[1], u + h / 2 * k1[2], t + h / 2)
    k3 = f(q + h / 2 * k2[0], v + h / 2 * k2[1], u + h / 2 * k2[2], t + h / 2)
    k4 = f(q + h * k3[0], v + h * k3[1], u + h * k3[2], t + h)
    q_new = q + h / 6 * (k1[0] + 2 * k2[0] + 2 * k3[0] + k4[0])
    for a, _ in quaternion_rows(model):
        q_new[a:a + 4] /= np.linalg.norm(q_new[a:a + 4])
    data.qpos[:] = q_new
    data.qvel[:] = v + h / 6 * (k1[1] + 2 * k2[1] + 2 * k3[1] + k4[1])
    data.act[:] = u + h / 6 * (k1[2] + 2 * k2[2] + 2 * k3[2] + k4[2])
    data.time = t + h
