# mistake: This is Heun's method, the mean of the slopes at both ends, which is of second order.
# next: Add the two slopes at the middle of the step and the weights of the classical method.
# status: incorrect
# told: This is Heun's method: second order, two slopes a
import mujoco
import numpy as np


def f(model, data, x, t):
    nq, nv = model.nq, model.nv
    data.qpos[:] = x[0:nq]
    data.qvel[:] = x[nq:nq + nv]
    data.act[:] = x[nq + nv:]
    data.time = t
    mujoco.mj_forward(model, data)
    return np.hstack((data.qvel, data.qacc, data.act_dot))


def rk4_step(model, data):
    h = model.opt.timestep
    t = data.time
    x = np.hstack((data.qpos, data.qvel, data.act))
    predictor = f(model, data, x, t)
    corrector = f(model, data, x + h * predictor, t + h)
    x = x + h * (predictor + corrector) / 2
    nq, nv = model.nq, model.nv
    data.qpos[:], data.qvel[:], data.act[:] = x[:nq], x[nq:nq + nv], x[nq + nv:]
    data.time = t + h
