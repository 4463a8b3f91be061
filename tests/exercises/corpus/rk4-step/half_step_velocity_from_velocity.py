# mistake: the second stage's velocity is v + h/2 * k1q: it adds a velocity (k1q) where the acceleration k1v belongs
# status: incorrect
# told: Your velocities move by velocities: the slope of data.qpos is data.qvel
import mujoco


def rk4_step(model, data):
    h = model.opt.timestep
    t = data.time
    q, v, s = data.qpos.copy(), data.qvel.copy(), data.act.copy()

    mujoco.mj_forward(model, data)
    k1q = data.qvel.copy()
    k1v = data.qacc.copy()
    k1s = data.act_dot.copy()

    data.qpos[:] = q + h / 2 * k1q
    data.qvel[:] = v + h / 2 * k1q
    data.act[:] = s + h / 2 * k1s
    data.time = t + h / 2
    mujoco.mj_forward(model, data)
    k2q = data.qvel.copy()
    k2v = data.qacc.copy()
    k2s = data.act_dot.copy()

    data.qpos[:] = q + h / 2 * k2q
    data.qvel[:] = v + h / 2 * k2v
    data.act[:] = s + h / 2 * k2s
    data.time = t + h / 2
    mujoco.mj_forward(model, data)
    k3q = data.qvel.copy()
    k3v = data.qacc.copy()
    k3s = data.act_dot.copy()

    data.qpos[:] = q + h * k3q
    data.qvel[:] = v + h * k3v
    data.act[:] = s + h * k3s
    data.time = t + h
    mujoco.mj_forward(model, data)
    k4q = data.qvel.copy()
    k4v = data.qacc.copy()
    k4s = data.act_dot.copy()

    data.qpos[:] = q + h / 6 * (k1q + 2 * k2q + 2 * k3q + k4q)
    data.qvel[:] = v + h / 6 * (k1v + 2 * k2v + 2 * k3v + k4v)
    data.act[:] = s + h / 6 * (k1s + 2 * k2s + 2 * k3s + k4s)
