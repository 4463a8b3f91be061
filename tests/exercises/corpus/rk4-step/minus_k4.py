# mistake: k4 is subtracted: a sign.
# next: Add the last slope.
# status: incorrect
# told: For the velocity, your step subtracts a slope: it moves by h/6 k1 + h/3 k2 + h/3 k3 - h/6 k4.
import mujoco


def rk4_step(model, data):
    h = model.opt.timestep
    t = data.time
    q = data.qpos.copy()
    v = data.qvel.copy()
    a = data.act.copy()

    mujoco.mj_forward(model, data)
    k1q = v.copy()
    k1v = data.qacc.copy()
    k1a = data.act_dot.copy()

    data.qpos[:] = q + h / 2 * k1q
    data.qvel[:] = v + h / 2 * k1v
    data.act[:] = a + h / 2 * k1a
    data.time = t + h / 2
    mujoco.mj_forward(model, data)
    k2q = data.qvel.copy()
    k2v = data.qacc.copy()
    k2a = data.act_dot.copy()

    data.qpos[:] = q + h / 2 * k2q
    data.qvel[:] = v + h / 2 * k2v
    data.act[:] = a + h / 2 * k2a
    data.time = t + h / 2
    mujoco.mj_forward(model, data)
    k3q = data.qvel.copy()
    k3v = data.qacc.copy()
    k3a = data.act_dot.copy()

    data.qpos[:] = q + h * k3q
    data.qvel[:] = v + h * k3v
    data.act[:] = a + h * k3a
    data.time = t + h
    mujoco.mj_forward(model, data)
    k4q = data.qvel.copy()
    k4v = data.qacc.copy()
    k4a = data.act_dot.copy()

    data.qpos[:] = q + h * (k1q + 2 * k2q + 2 * k3q + k4q) / 6
    data.qvel[:] = v + h * (k1v + 2 * k2v + 2 * k3v - k4v) / 6
    data.act[:] = a + h * (k1a + 2 * k2a + 2 * k3a + k4a) / 6
    data.time = t + h
