# mistake: The quaternion is read as (x, y, z, w), but MuJoCo keeps w first.
# next: Treat qpos[3:7] of a free joint as (w, x, y, z).
# status: incorrect
# told: The quaternion is read
import mujoco
import numpy as np


def rotate_quat(q, w, dt):
    """q: x y z w"""
    angle = np.linalg.norm(w) * dt
    if angle == 0:
        return q.copy()
    axis = w / np.linalg.norm(w)
    dq = np.append(np.sin(angle / 2) * axis, np.cos(angle / 2))
    x1, y1, z1, w1 = q
    x2, y2, z2, w2 = dq
    return np.array([
        w1 * x2 + x1 * w2 + y1 * z2 - z1 * y2,
        w1 * y2 - x1 * z2 + y1 * w2 + z1 * x2,
        w1 * z2 + x1 * y2 - y1 * x2 + z1 * w2,
        w1 * w2 - x1 * x2 - y1 * y2 - z1 * z2,
    ])


def integrate(model, q, v, dt):
    q = q.copy()
    for j in range(model.njnt):
        i, k = model.jnt_qposadr[j], model.jnt_dofadr[j]
        t = model.jnt_type[j]
        if t == 0:
            q[i:i + 3] += dt * v[k:k + 3]
            q[i + 3:i + 7] = rotate_quat(q[i + 3:i + 7], v[k + 3:k + 6], dt)
        elif t == 1:
            q[i:i + 4] = rotate_quat(q[i:i + 4], v[k:k + 3], dt)
        else:
            q[i] += dt * v[k]
    return q


def rk4_step(model, data):
    h = model.opt.timestep
    q, v, z, t = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.time

    def f(qq, vv, zz, tt):
        data.qpos[:] = qq; data.qvel[:] = vv; data.act[:] = zz; data.time = tt
        mujoco.mj_forward(model, data)
        return data.qacc.copy(), data.act_dot.copy()

    a1, z1 = f(q, v, z, t)
    v2 = v + h/2*a1
    a2, z2 = f(integrate(model, q, v, h/2), v2, z + h/2*z1, t + h/2)
    v3 = v + h/2*a2
    a3, z3 = f(integrate(model, q, v2, h/2), v3, z + h/2*z2, t + h/2)
    v4 = v + h*a3
    a4, z4 = f(integrate(model, q, v3, h), v4, z + h*z3, t + h)
    data.qpos[:] = integrate(model, q, (v + 2*v2 + 2*v3 + v4)/6, h)
    data.qvel[:] = v + h/6*(a1 + 2*a2 + 2*a3 + a4)
    data.act[:] = z + h/6*(z1 + 2*z2 + 2*z3 + z4)
    data.time = t + h
