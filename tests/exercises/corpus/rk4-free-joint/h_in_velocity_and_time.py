# mistake: h is multiplied twice: once into the velocity, once as time.
# next: Multiply by h once.
# status: incorrect
# told: h is applied twice to the position, in every stage and at the end: once to the slope, and once
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
        mujoco.mj_integratePos(model, q, s * vel, s)
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

    data.qpos[:] = shifted((v1 + 2 * v2 + 2 * v3 + v4) / 6, h)
    data.qvel[:] = v0 + h * (a1 + 2 * a2 + 2 * a3 + a4) / 6
    data.act[:] = a0 + h * (d1 + 2 * d2 + 2 * d3 + d4) / 6
    data.time = t + h
