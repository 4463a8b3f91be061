# mistake: The mean velocity is divided by its length.
# next: Leave the length of the mean as it is.
# status: incorrect
# told: At the end of your step the positions move along the weighted mean of the velocities, but by h
import mujoco
import numpy as np


def rk4_step(model, data):
    h = model.opt.timestep
    t = data.time
    q0 = data.qpos.copy()
    v0 = data.qvel.copy()
    a0 = data.act.copy()

    def shifted(vel, s):
        q = q0.copy()
        mujoco.mj_integratePos(model, q, vel, s)
        return q

    def evaluate():
        mujoco.mj_forward(model, data)
        return data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()

    v1, a1, d1 = evaluate()

    data.qpos[:] = shifted(v1, h / 2)
    data.qvel[:] = v0 + h / 2 * a1
    data.act[:] = a0 + h / 2 * d1
    data.time = t + h / 2
    v2, a2, d2 = evaluate()

    data.qpos[:] = shifted(v2, h / 2)
    data.qvel[:] = v0 + h / 2 * a2
    data.act[:] = a0 + h / 2 * d2
    v3, a3, d3 = evaluate()

    data.qpos[:] = shifted(v3, h)
    data.qvel[:] = v0 + h * a3
    data.act[:] = a0 + h * d3
    data.time = t + h
    v4, a4, d4 = evaluate()

    mean = (v1 + 2 * v2 + 2 * v3 + v4) / 6
    mean = mean / np.linalg.norm(mean)
    data.qpos[:] = shifted(mean, h)
    data.qvel[:] = v0 + h * (a1 + 2 * a2 + 2 * a3 + a4) / 6
    data.act[:] = a0 + h * (d1 + 2 * d2 + 2 * d3 + d4) / 6
    data.time = t + h
