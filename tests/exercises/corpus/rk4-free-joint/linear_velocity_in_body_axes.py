# mistake: The linear velocity of a free joint is turned by the body's orientation, although it is already in world axes.
# next: Add qvel[0:3] as it is; only qvel[3:6] is in the body's axes.
# status: partial
# told: The linear velocity of a free joint is in world axes already
# told from MuJoCo 4.0.0: incorrect: The linear velocity of a free joint is in world axes already
import mujoco
import numpy as np


def integrate(model, q, v, dt):
    v = v.copy()
    for j in range(model.njnt):
        if model.jnt_type[j] == int(mujoco.mjtJoint.mjJNT_FREE):
            a, d = model.jnt_qposadr[j], model.jnt_dofadr[j]
            world = np.zeros(3)
            mujoco.mju_rotVecQuat(world, v[d:d + 3], q[a + 3:a + 7])
            v[d:d + 3] = world
    out = q.copy()
    mujoco.mj_integratePos(model, out, v, dt)
    return out


def rk4_step(model, data):
    h = model.opt.timestep
    q0, v0, w0, t0 = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.time

    def f(dt, k):
        if k is None:
            data.qpos[:], data.qvel[:], data.act[:] = q0, v0, w0
        else:
            data.qpos[:] = integrate(model, q0, k[0], dt)
            data.qvel[:] = v0 + dt * k[1]
            data.act[:] = w0 + dt * k[2]
        data.time = t0 + dt
        mujoco.mj_forward(model, data)
        return data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()

    k1 = f(0, None)
    k2 = f(h / 2, k1)
    k3 = f(h / 2, k2)
    k4 = f(h, k3)
    mean = [(a + 2 * b + 2 * c + d) / 6 for a, b, c, d in zip(k1, k2, k3, k4)]
    data.qpos[:] = integrate(model, q0, mean[0], h)
    data.qvel[:] = v0 + h * mean[1]
    data.act[:] = w0 + h * mean[2]
    data.time = t0 + h
