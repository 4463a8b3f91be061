# mistake: The slopes are kept in an array for exactly two joints, so a model with three joints breaks it.
# next: Size the arrays by model.nq and model.nv.
# status: partial
# told: hidden case 4: ValueError, in line 9 of your
import mujoco
import numpy as np


def store_slope(table, row, data):
    table[row, 0:2] = data.qvel
    table[row, 2:4] = data.qacc


def set_state(data, start, shift):
    data.qpos[:] = start[0:2] + shift[0:2]
    data.qvel[:] = start[2:4] + shift[2:4]


def rk4_step(model, data):
    h = model.opt.timestep
    start = np.concatenate((data.qpos, data.qvel))
    act = data.act.copy()
    t = data.time
    K = np.zeros((4, 4))
    dact = []
    for i, c in enumerate((0.0, 0.5, 0.5, 1.0)):
        if i:
            set_state(data, start, c * h * K[i - 1])
            data.act[:] = act + c * h * dact[-1]
        data.time = t + c * h
        mujoco.mj_forward(model, data)
        store_slope(K, i, data)
        dact.append(data.act_dot.copy())
    set_state(data, start, h / 6 * (K[0] + 2 * K[1] + 2 * K[2] + K[3]))
    data.act[:] = act + h / 6 * (dact[0] + 2 * dact[1] + 2 * dact[2] + dact[3])
    data.time = t + h
