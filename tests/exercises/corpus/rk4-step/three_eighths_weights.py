# mistake: the weights 1, 3, 3, 1 over 8 belong to the 3/8 rule, whose stages lie at thirds; here they are the classical halves
# status: incorrect
# told: The weights are those of the 3/8 rule (1, 3, 3, 1 over 8); the classical ones are 1, 2, 2, 1 over 6.
import mujoco
import numpy as np


def rk4_step(model, data):
    dt = model.opt.timestep
    t = data.time
    x = [np.array(data.qpos), np.array(data.qvel), np.array(data.act)]

    def f(x, t):
        data.qpos[:] = x[0]
        data.qvel[:] = x[1]
        data.act[:] = x[2]
        data.time = t
        mujoco.mj_forward(model, data)
        return [np.array(data.qvel), np.array(data.qacc), np.array(data.act_dot)]

    def add(x, s, k):
        return [xi + s * ki for xi, ki in zip(x, k)]

    k1 = f(x, t)
    k2 = f(add(x, dt / 2, k1), t + dt / 2)
    k3 = f(add(x, dt / 2, k2), t + dt / 2)
    k4 = f(add(x, dt, k3), t + dt)
    end = [xi + dt / 8 * (a + 3 * b + 3 * c + d) for xi, a, b, c, d in zip(x, k1, k2, k3, k4)]
    data.qpos[:], data.qvel[:], data.act[:] = end
    data.time = t + dt
