# diagnosis: Positions move by the mean of old and new velocity
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

    v_new = v + h / 6 * (k1v + 2 * k2v + 2 * k3v + k4v)
    data.qpos[:] = q + h * (v + v_new) / 2
    data.qvel[:] = v_new
    data.time = t + h
