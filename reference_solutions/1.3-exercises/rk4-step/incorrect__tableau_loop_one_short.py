# diagnosis: although data.time moves: no slope reaches data.qpos and data.qvel
import mujoco
import numpy as np

A = [
    [0, 0, 0, 0],
    [1 / 2, 0, 0, 0],
    [0, 1 / 2, 0, 0],
    [0, 0, 1, 0],
]
B = [1 / 6, 1 / 3, 1 / 3, 1 / 6]
C = [0, 1 / 2, 1 / 2, 1]


def rk4_step(model, data):
    h = model.opt.timestep
    t0 = data.time
    y0 = np.hstack((data.qpos, data.qvel, data.act))
    n = model.nv
    k = []
    for i in range(4):
        y = y0.copy()
        for j in range(i - 1):
            y += h * A[i][j] * k[j]
        data.qpos[:], data.qvel[:], data.act[:] = y[:n], y[n:2 * n], y[2 * n:]
        data.time = t0 + C[i] * h
        mujoco.mj_forward(model, data)
        k.append(np.hstack((data.qvel, data.qacc, data.act_dot)))
    y = y0 + h * sum(b * ki for b, ki in zip(B, k))
    data.qpos[:], data.qvel[:], data.act[:] = y[:n], y[n:2 * n], y[2 * n:]
    data.time = t0 + h
