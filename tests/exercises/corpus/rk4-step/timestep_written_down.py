# mistake: The timestep is written down as 2 ms instead of being read from the model.
# next: Use model.opt.timestep.
# status: partial
# told: At another timestep your step goes wrong: use model.opt.timestep, not a number of your
import mujoco

DT = 0.002  # 2 ms, from the lesson


def rk4_step(model, data):
    q, v, a, t = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.time

    def k(q_, v_, a_, t_):
        data.qpos[:] = q_
        data.qvel[:] = v_
        data.act[:] = a_
        data.time = t_
        mujoco.mj_forward(model, data)
        return v_, data.qacc.copy(), data.act_dot.copy()

    p1, r1, s1 = k(q, v, a, t)
    p2, r2, s2 = k(q + DT / 2 * p1, v + DT / 2 * r1, a + DT / 2 * s1, t + DT / 2)
    p3, r3, s3 = k(q + DT / 2 * p2, v + DT / 2 * r2, a + DT / 2 * s2, t + DT / 2)
    p4, r4, s4 = k(q + DT * p3, v + DT * r3, a + DT * s3, t + DT)
    data.qpos[:] = q + DT / 6 * (p1 + 2 * p2 + 2 * p3 + p4)
    data.qvel[:] = v + DT / 6 * (r1 + 2 * r2 + 2 * r3 + r4)
    data.act[:] = a + DT / 6 * (s1 + 2 * s2 + 2 * s3 + s4)
    data.time = t + DT
