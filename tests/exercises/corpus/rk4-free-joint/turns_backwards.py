# mistake: The quaternion is multiplied by the conjugate of the rotation, so orientations turn backwards.
# next: Multiply by (cos, sin * axis), without the minus.
# status: incorrect
# told: Your orientations turn backwards: multiply the quaternion from the right by the
import mujoco
import numpy as np


def moved(model, qpos, vel, dt):
    new = qpos.copy()
    for j in range(model.njnt):
        p, d, kind = model.jnt_qposadr[j], model.jnt_dofadr[j], model.jnt_type[j]
        if kind == int(mujoco.mjtJoint.mjJNT_FREE):
            new[p : p + 3] += dt * vel[d : d + 3]
            p, d = p + 3, d + 3
        if kind <= 1:
            angle = np.linalg.norm(vel[d : d + 3]) * dt
            axis = vel[d : d + 3] / max(np.linalg.norm(vel[d : d + 3]), 1e-15)
            turn, inverse, out = np.zeros(4), np.zeros(4), np.zeros(4)
            mujoco.mju_axisAngle2Quat(turn, axis, angle)
            mujoco.mju_negQuat(inverse, turn)
            mujoco.mju_mulQuat(out, qpos[p : p + 4], inverse)
            new[p : p + 4] = out
        else:
            new[p] += dt * vel[d]
    return new


def rk4_step(model, data):
    h, t = model.opt.timestep, data.time
    q, v, a = data.qpos.copy(), data.qvel.copy(), data.act.copy()

    def stage(kq, kv, ka, dt):
        data.qpos[:] = moved(model, q, kq, dt)
        data.qvel[:] = v + dt * kv
        data.act[:] = a + dt * ka
        data.time = t + dt
        mujoco.mj_forward(model, data)
        return data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()

    k1 = stage(v, np.zeros(model.nv), np.zeros(model.na), 0)
    k2 = stage(*k1, h / 2)
    k3 = stage(*k2, h / 2)
    k4 = stage(*k3, h)
    mean = [(a1 + 2 * a2 + 2 * a3 + a4) / 6 for a1, a2, a3, a4 in zip(k1, k2, k3, k4)]
    data.qpos[:] = moved(model, q, mean[0], h)
    data.qvel[:] = v + h * mean[1]
    data.act[:] = a + h * mean[2]
    data.time = t + h
