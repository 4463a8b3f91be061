# mistake: Activations are never advanced: data.act keeps its first value for ever.
# next: Treat data.act as part of the state, with data.act_dot as its slope.
# status: partial
# told: data.act does not change: advance it with data.act_dot, as you advance qvel with
import mujoco


def rk4_step(model, data):
    """classical RK4, state = (q, v)"""
    h = model.opt.timestep
    q, v, t = data.qpos.copy(), data.qvel.copy(), data.time

    def acc(qi, vi, ti):
        data.qpos[:] = qi
        data.qvel[:] = vi
        data.time = ti
        mujoco.mj_forward(model, data)
        return data.qacc.copy()

    v1 = v
    a1 = acc(q, v1, t)
    v2 = v + a1 * h / 2
    a2 = acc(q + v1 * h / 2, v2, t + h / 2)
    v3 = v + a2 * h / 2
    a3 = acc(q + v2 * h / 2, v3, t + h / 2)
    v4 = v + a3 * h
    a4 = acc(q + v3 * h, v4, t + h)

    data.qpos[:] = q + (v1 + 2 * v2 + 2 * v3 + v4) * h / 6
    data.qvel[:] = v + (a1 + 2 * a2 + 2 * a3 + a4) * h / 6
    data.time = t + h
