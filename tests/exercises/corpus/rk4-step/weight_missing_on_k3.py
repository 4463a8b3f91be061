# mistake: The third slope is weighted once instead of twice, so the weights add up to five sixths.
# next: Use h (k1 + 2 k2 + 2 k3 + k4) / 6.
# status: incorrect
# told: Your weights are 1/6, 1/3, 1/6, 1/6 and sum to 5/6, not to 1; the classical weights are
import mujoco


def accel(model, data, q, v, t):
    data.qpos[:] = q
    data.qvel[:] = v
    data.time = t
    mujoco.mj_forward(model, data)
    return data.qacc.copy(), data.act_dot.copy()


def rk4_step(model, data):
    h = model.opt.timestep
    q0 = data.qpos.copy()
    v0 = data.qvel.copy()
    a0 = data.act.copy()
    t0 = data.time

    k1v, k1w = accel(model, data, q0, v0, t0)
    k1q = v0

    k2q = v0 + h / 2 * k1v
    data.act[:] = a0 + h / 2 * k1w
    k2v, k2w = accel(model, data, q0 + h / 2 * k1q, k2q, t0 + h / 2)

    k3q = v0 + h / 2 * k2v
    data.act[:] = a0 + h / 2 * k2w
    k3v, k3w = accel(model, data, q0 + h / 2 * k2q, k3q, t0 + h / 2)

    k4q = v0 + h * k3v
    data.act[:] = a0 + h * k3w
    k4v, k4w = accel(model, data, q0 + h * k3q, k4q, t0 + h)

    data.qpos[:] = q0 + h / 6 * (k1q + 2 * k2q + k3q + k4q)
    data.qvel[:] = v0 + h / 6 * (k1v + 2 * k2v + k3v + k4v)
    data.act[:] = a0 + h / 6 * (k1w + 2 * k2w + k3w + k4w)
    data.time = t0 + h
