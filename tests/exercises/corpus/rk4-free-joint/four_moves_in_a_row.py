# mistake: The final position is moved by the four stage velocities one after the other, and rotations in sequence do not add up.
# next: Sum the four velocities first and call mj_integratePos once.
# status: incorrect
# told: The position is moved four times, by one weighted velocity after the other, but rotations
import mujoco


def rk4_step(model, data):
    h = model.opt.timestep
    q0, v0, act0, t0 = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.time

    def moved(vel, dt):
        q = q0.copy()
        mujoco.mj_integratePos(model, q, vel, dt)
        return q

    def evaluate(q, v, act, t):
        data.qpos[:] = q
        data.qvel[:] = v
        data.act[:] = act
        data.time = t
        mujoco.mj_forward(model, data)
        return data.qacc.copy(), data.act_dot.copy()

    a1, s1 = evaluate(q0, v0, act0, t0)
    v2 = v0 + h / 2 * a1
    a2, s2 = evaluate(moved(v0, h / 2), v2, act0 + h / 2 * s1, t0 + h / 2)
    v3 = v0 + h / 2 * a2
    a3, s3 = evaluate(moved(v2, h / 2), v3, act0 + h / 2 * s2, t0 + h / 2)
    v4 = v0 + h * a3
    a4, s4 = evaluate(moved(v3, h), v4, act0 + h * s3, t0 + h)

    q = q0.copy()
    for vel, weight in ((v0, 1), (v2, 2), (v3, 2), (v4, 1)):
        mujoco.mj_integratePos(model, q, vel, weight * h / 6)
    data.qpos[:] = q
    data.qvel[:] = v0 + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    data.act[:] = act0 + h / 6 * (s1 + 2 * s2 + 2 * s3 + s4)
    data.time = t0 + h
