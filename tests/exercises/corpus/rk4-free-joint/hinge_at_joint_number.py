# mistake: a hinge is looked up in qpos and qvel by its joint number j instead of jnt_qposadr[j] and jnt_dofadr[j]
# status: partial
# told: The position of a hinge or slide never changes, although its velocity does: move those as well, at model.jnt_qposadr
# told from MuJoCo 4.0.0: incorrect: of second order on rotations only
import math

import mujoco
import numpy as np


def multiply(a, b):
    w, x, y, z = a
    s, i, j, k = b
    return np.array([
        w * s - x * i - y * j - z * k,
        w * i + x * s + y * k - z * j,
        w * j - x * k + y * s + z * i,
        w * k + x * j - y * i + z * s,
    ])


def turn(quat, omega, h):
    angle = np.linalg.norm(omega) * h
    if angle == 0:
        return quat.copy()
    axis = omega / np.linalg.norm(omega)
    rotation = np.concatenate([[math.cos(angle / 2)], math.sin(angle / 2) * axis])
    new = multiply(quat, rotation)
    return new / np.linalg.norm(new)


def move(model, qpos, vel, h):
    out = qpos.copy()
    for j in range(model.njnt):
        qa, va = model.jnt_qposadr[j], model.jnt_dofadr[j]
        kind = model.jnt_type[j]
        if kind == mujoco.mjtJoint.mjJNT_FREE:
            out[qa:qa + 3] += h * vel[va:va + 3]
            out[qa + 3:qa + 7] = turn(qpos[qa + 3:qa + 7], vel[va + 3:va + 6], h)
        elif kind == mujoco.mjtJoint.mjJNT_BALL:
            out[qa:qa + 4] = turn(qpos[qa:qa + 4], vel[va:va + 3], h)
        else:
            out[j] += h * vel[j]
    return out


def rk4_step(model, data):
    h = model.opt.timestep
    q, v, act, t = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.time

    def moved(velocity, dt):
        return move(model, q, velocity, dt)

    def slope(position, velocity, activation, time):
        data.qpos[:], data.qvel[:], data.act[:], data.time = position, velocity, activation, time
        mujoco.mj_forward(model, data)
        return data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()

    k1 = slope(q, v, act, t)
    k2 = slope(moved(k1[0], h / 2), v + h / 2 * k1[1], act + h / 2 * k1[2], t + h / 2)
    k3 = slope(moved(k2[0], h / 2), v + h / 2 * k2[1], act + h / 2 * k2[2], t + h / 2)
    k4 = slope(moved(k3[0], h), v + h * k3[1], act + h * k3[2], t + h)

    data.qpos[:] = moved((k1[0] + 2 * k2[0] + 2 * k3[0] + k4[0]) / 6, h)
    data.qvel[:] = v + h / 6 * (k1[1] + 2 * k2[1] + 2 * k3[1] + k4[1])
    data.act[:] = act + h / 6 * (k1[2] + 2 * k2[2] + 2 * k3[2] + k4[2])
    data.time = t + h
