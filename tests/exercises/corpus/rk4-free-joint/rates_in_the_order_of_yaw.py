# mistake: The angular velocity is taken in the order yaw, pitch, roll (z, y, x) before it turns the quaternion.
# next: Leave the three numbers in data.qvel in their order, x, y, z.
# status: incorrect
# told: Your velocities move as they should, but your orientations do not
import mujoco
import numpy as np


def advance(model, q, v, h):
    q = q.copy()
    for j in range(model.njnt):
        a, d = model.jnt_qposadr[j], model.jnt_dofadr[j]
        if model.jnt_type[j] == 0:
            q[a : a + 3] += h * v[d : d + 3]
            a, d = a + 3, d + 3
        if model.jnt_type[j] <= 1:
            mujoco.mju_quatIntegrate(q[a : a + 4], v[d : d + 3][::-1].copy(), h)
        else:
            q[a] += h * v[d]
    return q


def rk4_step(model, data):
    h = model.opt.timestep
    q, v, w, t = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.time
    k = [(0 * v, 0 * v, 0 * w)]
    for c in (0, h / 2, h / 2, h):
        data.qpos[:] = advance(model, q, k[-1][0], c)
        data.qvel[:] = v + c * k[-1][1]
        data.act[:] = w + c * k[-1][2]
        data.time = t + c
        mujoco.mj_forward(model, data)
        k.append((data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()))
    kv, ka, kw = ((k[1][i] + 2 * k[2][i] + 2 * k[3][i] + k[4][i]) / 6 for i in range(3))
    data.qpos[:] = advance(model, q, kv, h)
    data.qvel[:] = v + h * ka
    data.act[:] = w + h * kw
    data.time = t + h
