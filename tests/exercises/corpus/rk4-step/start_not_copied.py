# mistake: q0 and v0 are views into data, so the start of the step moves along with every stage.
# next: Keep copies: data.qpos.copy() and data.qvel.copy().
# status: incorrect
# told: The state is not restored between the stages: q and v alias data.qpos and data.qvel, so
"""RK4 for the double pendulum"""
import mujoco


def rk4_step(model, data):
    h = model.opt.timestep
    q0 = data.qpos
    v0 = data.qvel
    w0 = data.act.copy()
    t0 = data.time

    mujoco.mj_forward(model, data)
    k1_q = data.qvel.copy()
    k1_v = data.qacc.copy()
    k1_w = data.act_dot.copy()

    data.qpos[:] = q0 + 0.5 * h * k1_q
    data.qvel[:] = v0 + 0.5 * h * k1_v
    data.act[:] = w0 + 0.5 * h * k1_w
    data.time = t0 + 0.5 * h
    mujoco.mj_forward(model, data)
    k2_q = data.qvel.copy()
    k2_v = data.qacc.copy()
    k2_w = data.act_dot.copy()

    data.qpos[:] = q0 + 0.5 * h * k2_q
    data.qvel[:] = v0 + 0.5 * h * k2_v
    data.act[:] = w0 + 0.5 * h * k2_w
    mujoco.mj_forward(model, data)
    k3_q = data.qvel.copy()
    k3_v = data.qacc.copy()
    k3_w = data.act_dot.copy()

    data.qpos[:] = q0 + h * k3_q
    data.qvel[:] = v0 + h * k3_v
    data.act[:] = w0 + h * k3_w
    data.time = t0 + h
    mujoco.mj_forward(model, data)
    k4_q = data.qvel.copy()
    k4_v = data.qacc.copy()
    k4_w = data.act_dot.copy()

    data.qpos[:] = q0 + h * (k1_q + 2 * k2_q + 2 * k3_q + k4_q) / 6
    data.qvel[:] = v0 + h * (k1_v + 2 * k2_v + 2 * k3_v + k4_v) / 6
    data.act[:] = w0 + h * (k1_w + 2 * k2_w + 2 * k3_w + k4_w) / 6
