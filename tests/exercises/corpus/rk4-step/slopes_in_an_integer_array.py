# mistake: The slopes are stored in arrays of integers, which cut off every fraction.
# next: Make the arrays of slopes floats: np.zeros((4, model.nv)).
# status: incorrect
# told: The slopes in your stages are cut off to whole numbers: an array of whole numbers,
import mujoco
import numpy as np

STEPS = [0, 1 / 2, 1 / 2, 1]
WEIGHTS = [1, 2, 2, 1]


def rk4_step(model, data):
    h = model.opt.timestep
    q0, v0, a0, t0 = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.time
    kq = np.zeros((4, model.nq), dtype=int)
    kv = np.zeros((4, model.nv), dtype=int)
    ka = np.zeros((4, model.na))
    for s in range(4):
        if s > 0:
            data.qpos[:] = q0 + STEPS[s] * h * kq[s - 1]
            data.qvel[:] = v0 + STEPS[s] * h * kv[s - 1]
            data.act[:] = a0 + STEPS[s] * h * ka[s - 1]
        data.time = t0 + STEPS[s] * h
        mujoco.mj_forward(model, data)
        kq[s] = data.qvel
        kv[s] = data.qacc
        ka[s] = data.act_dot
    data.qpos[:] = q0 + h / 6 * np.dot(WEIGHTS, kq)
    data.qvel[:] = v0 + h / 6 * np.dot(WEIGHTS, kv)
    data.act[:] = a0 + h / 6 * np.dot(WEIGHTS, ka)
    data.time = t0 + h
