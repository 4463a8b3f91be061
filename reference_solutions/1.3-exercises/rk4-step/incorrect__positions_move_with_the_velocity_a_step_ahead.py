# diagnosis: slope were data.qvel + h data.qacc
import mujoco
import numpy as np
A = np.array([[0, 0, 0, 0], [.5, 0, 0, 0], [0, .5, 0, 0], [0, 0, 1, 0]])
b = np.array([1, 2, 2, 1]) / 6
c = A.sum(1)

def f(model, data, t, y):
    nq, nv = model.nq, model.nv
    data.time = t
    data.qpos[:] = y[:nq]
    data.qvel[:] = y[nq:nq + nv]
    data.act[:] = y[nq + nv:]
    mujoco.mj_forward(model, data)
    return np.hstack([data.qvel + model.opt.timestep * data.qacc, data.qacc, data.act_dot])

def rk4_step(model, data):
    h, t = model.opt.timestep, data.time
    y = np.hstack([data.qpos, data.qvel, data.act])
    K = np.zeros((4, y.size))
    for i in range(4):
        K[i] = f(model, data, t + c[i] * h, y + h * A[i] @ K)
    y = y + h * b @ K
    data.qpos[:], data.qvel[:], data.act[:] = np.split(y, [model.nq, model.nq + model.nv])
    data.time = t + h
