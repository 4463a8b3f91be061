# mistake: A gyroscopic term is added to qacc, which mj_forward has in it already.
# next: Integrate data.qacc as it is.
# status: incorrect
# told: The velocities in your stage 2 do not follow from data.qacc, as mj_forward left it in stage 1.
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
        acc = data.qacc.copy()
        I = model.body_inertia[1]
        w = data.qvel[-3:]
        acc[-3:] -= np.cross(w, I * w) / I   # Euler equations
        return data.qvel.copy(), acc, data.act_dot.copy()

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
