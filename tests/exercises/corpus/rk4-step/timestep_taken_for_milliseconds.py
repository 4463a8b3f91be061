# mistake: model.opt.timestep is divided by 1000 as if it were milliseconds; it is seconds already.
# next: Use model.opt.timestep as it is.
# status: incorrect
# told: Your stages 2, 3 and 4 lie 1/1000 times as far from the start as they should: move by
import mujoco


def rk4_step(model, data):
    h = model.opt.timestep / 1000  # ms -> s
    t = data.time
    q, v, a = data.qpos.copy(), data.qvel.copy(), data.act.copy()

    mujoco.mj_forward(model, data)
    k1q, k1v, k1a = data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()

    data.qpos[:], data.qvel[:], data.act[:] = q + h / 2 * k1q, v + h / 2 * k1v, a + h / 2 * k1a
    data.time = t + h / 2
    mujoco.mj_forward(model, data)
    k2q, k2v, k2a = data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()

    data.qpos[:], data.qvel[:], data.act[:] = q + h / 2 * k2q, v + h / 2 * k2v, a + h / 2 * k2a
    data.time = t + h / 2
    mujoco.mj_forward(model, data)
    k3q, k3v, k3a = data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()

    data.qpos[:], data.qvel[:], data.act[:] = q + h * k3q, v + h * k3v, a + h * k3a
    data.time = t + h
    mujoco.mj_forward(model, data)
    k4q, k4v, k4a = data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()

    data.qpos[:] = q + h / 6 * (k1q + 2 * k2q + 2 * k3q + k4q)
    data.qvel[:] = v + h / 6 * (k1v + 2 * k2v + 2 * k3v + k4v)
    data.act[:] = a + h / 6 * (k1a + 2 * k2a + 2 * k3a + k4a)
    data.time = t + h
