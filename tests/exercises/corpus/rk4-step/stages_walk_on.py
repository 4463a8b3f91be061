# mistake: data.qpos += ... at each stage: every stage starts from the stage before, not from the start of the step
# status: incorrect
# told: Each of your stages starts from the state of the stage before; restore q and v to
import mujoco


def rk4_step(model, data):
    h = model.opt.timestep
    q, v, act, t = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.time

    mujoco.mj_forward(model, data)
    k1q, k1v, k1a = data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()

    data.qpos += h / 2 * k1q
    data.qvel += h / 2 * k1v
    data.act += h / 2 * k1a
    data.time = t + h / 2
    mujoco.mj_forward(model, data)
    k2q, k2v, k2a = data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()

    data.qpos += h / 2 * k2q
    data.qvel += h / 2 * k2v
    data.act += h / 2 * k2a
    data.time = t + h / 2
    mujoco.mj_forward(model, data)
    k3q, k3v, k3a = data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()

    data.qpos += h * k3q
    data.qvel += h * k3v
    data.act += h * k3a
    data.time = t + h
    mujoco.mj_forward(model, data)
    k4q, k4v, k4a = data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()

    data.qpos[:] = q + h * (k1q + 2 * k2q + 2 * k3q + k4q) / 6
    data.qvel[:] = v + h * (k1v + 2 * k2v + 2 * k3v + k4v) / 6
    data.act[:] = act + h * (k1a + 2 * k2a + 2 * k3a + k4a) / 6
