# mistake: mj_integratePos moves data.qpos in place, and it is not set back to the start before the next stage.
# next: Set data.qpos[:] to the copy of the start before each mj_integratePos.
# status: incorrect
# told: Your stages move the positions in place, so that each starts from those of the stage
import mujoco


def rk4_step(model, data):
    h = model.opt.timestep
    q = data.qpos.copy()
    v = data.qvel.copy()
    act = data.act.copy()
    t = data.time

    mujoco.mj_forward(model, data)
    v1, a1, d1 = data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()

    mujoco.mj_integratePos(model, data.qpos, v1, h / 2)
    data.qvel[:] = v + h / 2 * a1
    data.act[:] = act + h / 2 * d1
    data.time = t + h / 2
    mujoco.mj_forward(model, data)
    v2, a2, d2 = data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()

    mujoco.mj_integratePos(model, data.qpos, v2, h / 2)
    data.qvel[:] = v + h / 2 * a2
    data.act[:] = act + h / 2 * d2
    mujoco.mj_forward(model, data)
    v3, a3, d3 = data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()

    mujoco.mj_integratePos(model, data.qpos, v3, h)
    data.qvel[:] = v + h * a3
    data.act[:] = act + h * d3
    data.time = t + h
    mujoco.mj_forward(model, data)
    v4, a4, d4 = data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()

    data.qpos[:] = q
    mujoco.mj_integratePos(model, data.qpos, (v1 + 2 * v2 + 2 * v3 + v4) / 6, h)
    data.qvel[:] = v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    data.act[:] = act + h / 6 * (d1 + 2 * d2 + 2 * d3 + d4)
