# mistake: The angle is turned into degrees before it goes into the sine and cosine, which take radians.
# next: Leave the angle in radians.
# status: incorrect
# told: Your turns go into sine and cosine in degrees: h times an angular velocity of MuJoCo
import math

import mujoco
import numpy as np


def rotation(w, dt):
    speed = np.linalg.norm(w)
    if speed < 1e-12:
        return np.array([1.0, 0, 0, 0])
    half = math.degrees(speed * dt) / 2
    return np.concatenate([[math.cos(half)], math.sin(half) * w / speed])


def multiply(p, q):
    s = p[0] * q[0] - p[1:] @ q[1:]
    return np.concatenate([[s], p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:])])


def advance(model, q, u, dt):
    q = q.copy()
    for kind, p, d in zip(model.jnt_type, model.jnt_qposadr, model.jnt_dofadr):
        if kind == 0:
            q[p : p + 3] += u[d : d + 3] * dt
            q[p + 3 : p + 7] = multiply(q[p + 3 : p + 7], rotation(u[d + 3 : d + 6], dt))
        elif kind == 1:
            q[p : p + 4] = multiply(q[p : p + 4], rotation(u[d : d + 3], dt))
        else:
            q[p] += u[d] * dt
    return q


def rk4_step(model, data):
    h, t0 = model.opt.timestep, data.time
    q0, v0, a0 = data.qpos.copy(), data.qvel.copy(), data.act.copy()
    k = []
    for c in (0, h / 2, h / 2, h):
        if k:
            data.qpos[:] = advance(model, q0, k[-1][0], c)
            data.qvel[:] = v0 + c * k[-1][1]
            data.act[:] = a0 + c * k[-1][2]
        data.time = t0 + c
        mujoco.mj_forward(model, data)
        k.append((data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()))
    u, dv, da = (sum(w * s[i] for w, s in zip((1, 2, 2, 1), k)) / 6 for i in range(3))
    data.qpos[:] = advance(model, q0, u, h)
    data.qvel[:] = v0 + h * dv
    data.act[:] = a0 + h * da
    data.time = t0 + h
