# diagnosis: third-order
import mujoco


def rk4_step(model, data):
    h, t, q, v = model.opt.timestep, data.time, data.qpos.copy(), data.qvel.copy()

    def f(q, v, t):
        data.qpos[:], data.qvel[:], data.time = q, v, t
        mujoco.mj_forward(model, data)
        return v.copy(), data.qacc.copy()

    k = f(q, v, t)
    m = f(q + h / 2 * k[0], v + h / 2 * k[1], t + h / 2)
    n = f(q + h * (2 * m[0] - k[0]), v + h * (2 * m[1] - k[1]), t + h)
    data.qpos[:] = q + h / 6 * (k[0] + 4 * m[0] + n[0])
    data.qvel[:] = v + h / 6 * (k[1] + 4 * m[1] + n[1])
    data.time = t + h
