# mistake: data.time += h/2 at both middle stages, so stage 3 is evaluated at t + h and not at t + h/2
# status: partial
# told: data.time is t + h when stage 3 is evaluated: set it to t, t + h/2, t + h/2 and t +
import mujoco
import numpy as np


def rk4_step(model, data):
    h = model.opt.timestep
    start = data.time
    y = np.concatenate([data.qpos, data.qvel, data.act])
    nq, nv = model.nq, model.nv

    def put(state):
        data.qpos[:] = state[:nq]
        data.qvel[:] = state[nq:nq + nv]
        data.act[:] = state[nq + nv:]

    def f(state):
        put(state)
        mujoco.mj_forward(model, data)
        return np.concatenate([data.qvel, data.qacc, data.act_dot])

    k1 = f(y)
    data.time += h / 2
    k2 = f(y + 0.5 * h * k1)
    data.time += h / 2
    k3 = f(y + 0.5 * h * k2)
    data.time = start + h
    k4 = f(y + h * k3)
    put(y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4))
