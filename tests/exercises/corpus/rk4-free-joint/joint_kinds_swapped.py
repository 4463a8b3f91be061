# mistake: The numbers of the joint types are confused: 1 is taken for a free joint and 0 for a ball joint.
# next: Compare with int(mujoco.mjtJoint.mjJNT_FREE) and int(mujoco.mjtJoint.mjJNT_BALL).
# status: incorrect
# told: The first four numbers of a free joint in data.qpos turn like a quaternion
import mujoco
import numpy as np

BALL, FREE = 0, 1


def add(model, q, v, dt):
    q = q.copy()
    qi = vi = 0
    for kind in model.jnt_type:
        if kind == FREE:
            q[qi:qi + 3] += v[vi:vi + 3] * dt
            quat = q[qi + 3:qi + 7]
            mujoco.mju_quatIntegrate(quat, v[vi + 3:vi + 6], dt)
            q[qi + 3:qi + 7] = quat
            qi, vi = qi + 7, vi + 6
        elif kind == BALL:
            quat = q[qi:qi + 4]
            mujoco.mju_quatIntegrate(quat, v[vi:vi + 3], dt)
            q[qi:qi + 4] = quat
            qi, vi = qi + 4, vi + 3
        else:
            q[qi] += v[vi] * dt
            qi, vi = qi + 1, vi + 1
    return q


def rk4_step(model, data):
    h = model.opt.timestep
    q, v, act, t = np.array(data.qpos), np.array(data.qvel), np.array(data.act), data.time

    def acc(q_, v_, act_, t_):
        data.qpos[:], data.qvel[:], data.act[:], data.time = q_, v_, act_, t_
        mujoco.mj_forward(model, data)
        return np.array(data.qacc), np.array(data.act_dot)

    a1, r1 = acc(q, v, act, t)
    v2 = v + h / 2 * a1
    a2, r2 = acc(add(model, q, v, h / 2), v2, act + h / 2 * r1, t + h / 2)
    v3 = v + h / 2 * a2
    a3, r3 = acc(add(model, q, v2, h / 2), v3, act + h / 2 * r2, t + h / 2)
    v4 = v + h * a3
    a4, r4 = acc(add(model, q, v3, h), v4, act + h * r3, t + h)
    data.qpos[:] = add(model, q, (v + 2 * v2 + 2 * v3 + v4) / 6, h)
    data.qvel[:] = v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    data.act[:] = act + h / 6 * (r1 + 2 * r2 + 2 * r3 + r4)
    data.time = t + h
