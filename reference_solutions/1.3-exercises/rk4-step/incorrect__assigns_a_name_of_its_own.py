# diagnosis: the new values went into variables of your own
import mujoco


def acceleration(model, data, q, v, t):
    data.qpos[:] = q
    data.qvel[:] = v
    data.time = t
    mujoco.mj_forward(model, data)
    return data.qacc.copy()


def rk4_step(model, data):
    h = model.opt.timestep
    t = data.time
    q = data.qpos.copy()
    v = data.qvel.copy()

    k1v = acceleration(model, data, q, v, t)
    k1q = v
    k2v = acceleration(model, data, q + 0.5 * h * k1q, v + 0.5 * h * k1v, t + 0.5 * h)
    k2q = v + 0.5 * h * k1v
    k3v = acceleration(model, data, q + 0.5 * h * k2q, v + 0.5 * h * k2v, t + 0.5 * h)
    k3q = v + 0.5 * h * k2v
    k4v = acceleration(model, data, q + h * k3q, v + h * k3v, t + h)
    k4q = v + h * k3v

    qpos, qvel = data.qpos, data.qvel
    qpos[:], qvel[:] = q, v
    qpos = q + h / 6 * (k1q + 2 * k2q + 2 * k3q + k4q)
    qvel = v + h / 6 * (k1v + 2 * k2v + 2 * k3v + k4v)
    data.time = t + h
