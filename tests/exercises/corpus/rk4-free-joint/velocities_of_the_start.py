# mistake: All stage positions move with the velocity of the start of the step.
# next: Move each stage's position with the velocity of the stage before.
# status: incorrect
# told: Your stages all move the position with the velocity at the start of the step; use the
import mujoco


def rk4_step(model, data):
    h = model.opt.timestep
    q, v, w, t = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.time

    q_half, q_full = q.copy(), q.copy()
    mujoco.mj_integratePos(model, q_half, v, h / 2)
    mujoco.mj_integratePos(model, q_full, v, h)

    def acc(qs, vs, ws, ts):
        data.qpos[:] = qs
        data.qvel[:] = vs
        data.act[:] = ws
        data.time = ts
        mujoco.mj_forward(model, data)
        return data.qacc.copy(), data.act_dot.copy()

    a1, w1 = acc(q, v, w, t)
    v2 = v + h / 2 * a1
    a2, w2 = acc(q_half, v2, w + h / 2 * w1, t + h / 2)
    v3 = v + h / 2 * a2
    a3, w3 = acc(q_half, v3, w + h / 2 * w2, t + h / 2)
    v4 = v + h * a3
    a4, w4 = acc(q_full, v4, w + h * w3, t + h)
    data.qpos[:] = q
    mujoco.mj_integratePos(model, data.qpos, (v + 2 * v2 + 2 * v3 + v4) / 6, h)
    data.qvel[:] = v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    data.act[:] = w + h / 6 * (w1 + 2 * w2 + 2 * w3 + w4)
    data.time = t + h
