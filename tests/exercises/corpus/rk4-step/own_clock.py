# mistake: The time is counted in a variable of the module, which goes on counting from one run to the next instead of starting at data.time.
# next: Take the time of the start from data.time.
# status: partial
# told: In your first stage data.time is not the time at which the step began, but that of a clock
import mujoco

steps_done = 0


def rk4_step(model, data):
    global steps_done
    h = model.opt.timestep
    t = steps_done * h
    q, v, a = data.qpos.copy(), data.qvel.copy(), data.act.copy()

    def k(q_, v_, a_, t_):
        data.time = t_
        data.qpos[:] = q_
        data.qvel[:] = v_
        data.act[:] = a_
        mujoco.mj_forward(model, data)
        return v_, data.qacc.copy(), data.act_dot.copy()

    p1, r1, s1 = k(q, v, a, t)
    p2, r2, s2 = k(q + h / 2 * p1, v + h / 2 * r1, a + h / 2 * s1, t + h / 2)
    p3, r3, s3 = k(q + h / 2 * p2, v + h / 2 * r2, a + h / 2 * s2, t + h / 2)
    p4, r4, s4 = k(q + h * p3, v + h * r3, a + h * s3, t + h)
    data.qpos[:] = q + h / 6 * (p1 + 2 * p2 + 2 * p3 + p4)
    data.qvel[:] = v + h / 6 * (r1 + 2 * r2 + 2 * r3 + r4)
    data.act[:] = a + h / 6 * (s1 + 2 * s2 + 2 * s3 + s4)
    steps_done += 1
    data.time = steps_done * h
