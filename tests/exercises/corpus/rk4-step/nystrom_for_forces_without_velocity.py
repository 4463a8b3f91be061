# mistake: Nystrom's formula is used, which holds where forces do not depend on velocities: both middle stages lie at the same position q + h/2 v + h^2/8 a1.
# next: Move the positions of stage 3 with the velocity of stage 2: q + h/2 (v + h/2 a1).
# status: partial
# told: the position moves by the mean of its old and its own new velocity
import mujoco


def rk4_step(model, data):
    h = model.opt.timestep
    q, v, w, t = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.time

    def acc(qq, vv, ww, tt):
        data.qpos[:] = qq
        data.qvel[:] = vv
        data.act[:] = ww
        data.time = tt
        mujoco.mj_forward(model, data)
        return data.qacc.copy(), data.act_dot.copy()

    a1, w1 = acc(q, v, w, t)
    half = q + h / 2 * v + h**2 / 8 * a1
    a2, w2 = acc(half, v + h / 2 * a1, w + h / 2 * w1, t + h / 2)
    a3, w3 = acc(half, v + h / 2 * a2, w + h / 2 * w2, t + h / 2)
    a4, w4 = acc(q + h * v + h**2 / 2 * a3, v + h * a3, w + h * w3, t + h)
    data.qpos[:] = q + h * v + h**2 / 6 * (a1 + a2 + a3)
    data.qvel[:] = v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    data.act[:] = w + h / 6 * (w1 + 2 * w2 + 2 * w3 + w4)
    data.time = t + h
