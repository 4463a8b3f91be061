# diagnosis: given: model.opt.gravity is not as before
import mujoco
def rk4_step(model, data):
    model.opt.gravity[:] = 0
    h = model.opt.timestep
    q, v, w, t = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.time
    def slope(qq, vv, ww, tt):
        data.qpos[:] = qq
        data.qvel[:] = vv
        data.act[:] = ww
        data.time = tt
        mujoco.mj_forward(model, data)
        return data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()
    v1, a1, w1 = slope(q, v, w, t)
    v2, a2, w2 = slope(q + h / 2 * v1, v + h / 2 * a1, w + h / 2 * w1, t + h / 2)
    v3, a3, w3 = slope(q + h / 2 * v2, v + h / 2 * a2, w + h / 2 * w2, t + h / 2)
    v4, a4, w4 = slope(q + h * v3, v + h * a3, w + h * w3, t + h)
    data.qpos[:] = q + h / 6 * (v1 + 2 * v2 + 2 * v3 + v4)
    data.qvel[:] = v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    data.act[:] = w + h / 6 * (w1 + 2 * w2 + 2 * w3 + w4)
    data.time = t + h
