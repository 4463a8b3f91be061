# mistake: Activations are left out of the step: data.act is never moved.
# next: Advance data.act with data.act_dot at every stage and at the end.
# status: partial
# told: data.act does not change: advance it with data.act_dot, as you advance qvel with
# told from MuJoCo 4.0.0: incorrect: of second order on rotations only
import mujoco


def moved(model, q, v, dt):
    q = q.copy()
    mujoco.mj_integratePos(model, q, v, dt)
    return q


def rk4_step(model, data):
    h = model.opt.timestep
    q = data.qpos.copy()
    v = data.qvel.copy()
    t = data.time

    def a(qi, vi, ti):
        data.qpos[:] = qi
        data.qvel[:] = vi
        data.time = ti
        mujoco.mj_forward(model, data)
        return data.qacc.copy()

    a1 = a(q, v, t)
    v2 = v + h / 2 * a1
    a2 = a(moved(model, q, v, h / 2), v2, t + h / 2)
    v3 = v + h / 2 * a2
    a3 = a(moved(model, q, v2, h / 2), v3, t + h / 2)
    v4 = v + h * a3
    a4 = a(moved(model, q, v3, h), v4, t + h)

    data.qpos[:] = moved(model, q, (v + 2 * v2 + 2 * v3 + v4) / 6, h)
    data.qvel[:] = v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    data.time = t + h
