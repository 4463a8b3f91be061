# mistake: The state is rounded to eight decimals at the end of each step.
# next: Do not round inside the step; round only what you print.
# status: incorrect
# told: Your step rounds its result to 8 decimals
import mujoco
import numpy as np


def rk4_step(model, data):
    h = model.opt.timestep
    q, v, act, t = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.time
    k = [None] * 4
    c = (0, h / 2, h / 2, h)
    for i in range(4):
        prev = k[i - 1] or (0, 0, 0)
        data.qpos[:] = q + c[i] * prev[0]
        data.qvel[:] = v + c[i] * prev[1]
        data.act[:] = act + c[i] * prev[2]
        data.time = t + c[i]
        mujoco.mj_forward(model, data)
        k[i] = (data.qvel.copy(), data.qacc.copy(), data.act_dot.copy())
    s = [h / 6 * (k[0][j] + 2 * k[1][j] + 2 * k[2][j] + k[3][j]) for j in range(3)]
    data.qpos[:] = np.round(q + s[0], 8)
    data.qvel[:] = np.round(v + s[1], 8)
    data.act[:] = np.round(act + s[2], 8)
    data.time = t + h
