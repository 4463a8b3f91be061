# mistake: The increments already contain h, and the final sum is multiplied by h once more, so almost nothing moves.
# next: Multiply by h once: either in the increments or in the sum.
# status: incorrect
# told: h is applied twice to the velocity: once in k, once in the
import mujoco
import numpy as np


def rk4_step(model, data):
    h = model.opt.timestep
    nq = model.nq

    # pack everything in one vector, like in the numerics course
    y0 = np.concatenate([data.qpos, data.qvel, data.act])
    t0 = data.time

    def f(t, y):
        data.time = t
        data.qpos[:] = y[:nq]
        data.qvel[:] = y[nq : nq + model.nv]
        data.act[:] = y[nq + model.nv :]
        mujoco.mj_forward(model, data)
        return np.concatenate([data.qvel, data.qacc, data.act_dot])

    k1 = h * f(t0, y0)
    k2 = h * f(t0 + h / 2, y0 + k1 / 2)
    k3 = h * f(t0 + h / 2, y0 + k2 / 2)
    k4 = h * f(t0 + h, y0 + k3)
    y = y0 + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)

    data.qpos[:] = y[:nq]
    data.qvel[:] = y[nq : nq + model.nv]
    data.act[:] = y[nq + model.nv :]
    data.time = t0 + h
