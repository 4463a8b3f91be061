# mistake: data.time stays at the start of the step during all four stages, so forces that depend on time are taken at the wrong moment.
# next: Set data.time to t, t + h/2, t + h/2 and t + h before the four calls of mj_forward.
# status: partial
# told: data.time stands at the start of the step in all four calls of mj_forward: set data.time
import mujoco


def derivs(model, data, q, v, a):
    data.qpos[:], data.qvel[:], data.act[:] = q, v, a
    mujoco.mj_forward(model, data)
    return data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()


def rk4_step(model, data):
    h = model.opt.timestep
    y = (data.qpos.copy(), data.qvel.copy(), data.act.copy())

    def shifted(k, s):
        return tuple(yi + s * ki for yi, ki in zip(y, k))

    k1 = derivs(model, data, *y)
    k2 = derivs(model, data, *shifted(k1, h / 2))
    k3 = derivs(model, data, *shifted(k2, h / 2))
    k4 = derivs(model, data, *shifted(k3, h))
    k = tuple((a + 2 * b + 2 * c + d) / 6 for a, b, c, d in zip(k1, k2, k3, k4))
    data.qpos[:], data.qvel[:], data.act[:] = shifted(k, h)
    data.time += h
