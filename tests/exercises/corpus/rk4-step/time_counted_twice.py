# mistake: data.time is moved by h over the stages and then by h again at the end, so a step takes 2 h of time.
# next: Leave data.time at the start plus h.
# status: partial
# told: data.time advances by 2 h in a step: it adds up over the
import mujoco


def rk4_step(model, data):
    h = model.opt.timestep
    q, v, act = data.qpos.copy(), data.qvel.copy(), data.act.copy()

    mujoco.mj_forward(model, data)
    q1, v1, w1 = data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()

    data.time += h / 2
    data.qpos[:] = q + h / 2 * q1
    data.qvel[:] = v + h / 2 * v1
    data.act[:] = act + h / 2 * w1
    mujoco.mj_forward(model, data)
    q2, v2, w2 = data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()

    data.qpos[:] = q + h / 2 * q2
    data.qvel[:] = v + h / 2 * v2
    data.act[:] = act + h / 2 * w2
    mujoco.mj_forward(model, data)
    q3, v3, w3 = data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()

    data.time += h / 2
    data.qpos[:] = q + h * q3
    data.qvel[:] = v + h * v3
    data.act[:] = act + h * w3
    mujoco.mj_forward(model, data)
    q4, v4, w4 = data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()

    data.qpos[:] = q + h / 6 * (q1 + 2 * q2 + 2 * q3 + q4)
    data.qvel[:] = v + h / 6 * (v1 + 2 * v2 + 2 * v3 + v4)
    data.act[:] = act + h / 6 * (w1 + 2 * w2 + 2 * w3 + w4)
    data.time += h
