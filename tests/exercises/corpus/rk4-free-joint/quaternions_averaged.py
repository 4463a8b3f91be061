# mistake: the end position is the weighted mean of four end positions, quaternions added as numbers; average the velocities and move once
# status: incorrect
# told: Your stages turn the orientations as mj_integratePos does; the end of your step is
import mujoco
import numpy as np


def rk4_step(model, data):
    h = model.opt.timestep
    q, v, act, t = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.time

    def moved(velocity, dt):
        p = q.copy()
        mujoco.mj_integratePos(model, p, velocity, dt)
        return p

    def slope(position, velocity, activation, time):
        data.qpos[:], data.qvel[:], data.act[:], data.time = position, velocity, activation, time
        mujoco.mj_forward(model, data)
        return data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()

    k1 = slope(q, v, act, t)
    k2 = slope(moved(k1[0], h / 2), v + h / 2 * k1[1], act + h / 2 * k1[2], t + h / 2)
    k3 = slope(moved(k2[0], h / 2), v + h / 2 * k2[1], act + h / 2 * k2[2], t + h / 2)
    k4 = slope(moved(k3[0], h), v + h * k3[1], act + h * k3[2], t + h)

    ends = [moved(k[0], h) for k in (k1, k2, k3, k4)]
    data.qpos[:] = (ends[0] + 2 * ends[1] + 2 * ends[2] + ends[3]) / 6
    mujoco.mj_normalizeQuat(model, data.qpos)
    data.qvel[:] = v + h / 6 * (k1[1] + 2 * k2[1] + 2 * k3[1] + k4[1])
    data.act[:] = act + h / 6 * (k1[2] + 2 * k2[2] + 2 * k3[2] + k4[2])
    data.time = t + h
