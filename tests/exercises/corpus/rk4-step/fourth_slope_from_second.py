# mistake: the velocity of the fourth stage is reached with the second acceleration (a2) instead of the third (a3)
# status: incorrect
# told: In your stage 4, the velocity uses the slope of stage 2: it moves by h k2, not by h
import mujoco


def rk4_step(model, data):
    h = model.opt.timestep
    t = data.time
    q0 = data.qpos.copy()
    v0 = data.qvel.copy()
    w0 = data.act.copy()

    # stage 1
    mujoco.mj_forward(model, data)
    v1 = v0.copy()
    a1 = data.qacc.copy()
    w1 = data.act_dot.copy()

    # stage 2
    v2 = v0 + h / 2 * a1
    data.qpos[:] = q0 + h / 2 * v1
    data.qvel[:] = v2
    data.act[:] = w0 + h / 2 * w1
    data.time = t + h / 2
    mujoco.mj_forward(model, data)
    a2 = data.qacc.copy()
    w2 = data.act_dot.copy()

    # stage 3
    v3 = v0 + h / 2 * a2
    data.qpos[:] = q0 + h / 2 * v2
    data.qvel[:] = v3
    data.act[:] = w0 + h / 2 * w2
    data.time = t + h / 2
    mujoco.mj_forward(model, data)
    a3 = data.qacc.copy()
    w3 = data.act_dot.copy()

    # stage 4
    v4 = v0 + h * a2
    data.qpos[:] = q0 + h * v3
    data.qvel[:] = v4
    data.act[:] = w0 + h * w3
    data.time = t + h
    mujoco.mj_forward(model, data)
    a4 = data.qacc.copy()
    w4 = data.act_dot.copy()

    data.qpos[:] = q0 + h / 6 * (v1 + 2 * v2 + 2 * v3 + v4)
    data.qvel[:] = v0 + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    data.act[:] = w0 + h / 6 * (w1 + 2 * w2 + 2 * w3 + w4)
    data.time = t + h
