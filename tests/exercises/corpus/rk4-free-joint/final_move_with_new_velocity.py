# mistake: The final position moves with the new velocity, not with the weighted mean of the four stage velocities.
# next: Pass (v1 + 2 v2 + 2 v3 + v4) / 6 to the last mj_integratePos.
# status: incorrect
# told: The position advances with the new velocity alone; use the weighted mean of the four
import mujoco


def forward(model, data, q, v, act, t):
    data.qpos[:] = q
    data.qvel[:] = v
    data.act[:] = act
    data.time = t
    mujoco.mj_forward(model, data)
    return data.qacc.copy(), data.act_dot.copy()


def displaced(model, q, v, dt):
    moved = q.copy()
    mujoco.mj_integratePos(model, moved, v, dt)
    return moved


def rk4_step(model, data):
    """Advance data by model.opt.timestep, with accelerations from mujoco.mj_forward alone."""
    h = model.opt.timestep
    q, v, act, t = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.time

    a1, r1 = forward(model, data, q, v, act, t)
    v2 = v + h / 2 * a1
    a2, r2 = forward(model, data, displaced(model, q, v, h / 2), v2, act + h / 2 * r1, t + h / 2)
    v3 = v + h / 2 * a2
    a3, r3 = forward(model, data, displaced(model, q, v2, h / 2), v3, act + h / 2 * r2, t + h / 2)
    v4 = v + h * a3
    a4, r4 = forward(model, data, displaced(model, q, v3, h), v4, act + h * r3, t + h)

    new_v = v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    data.qpos[:] = q
    mujoco.mj_integratePos(model, data.qpos, new_v, h)  # as in the starter
    data.qvel[:] = new_v
    data.act[:] = act + h / 6 * (r1 + 2 * r2 + 2 * r3 + r4)
    data.time = t + h
