# mistake: All of qpos[3:] is normalised as if it were one quaternion, which also scales hinges and further quaternions.
# next: Normalise each quaternion on its own, or not at all: mj_integratePos keeps the length.
# status: partial
# told: The free body is right, a ball joint is not: its quaternion stands alone in qpos, without
# told from MuJoCo 4.0.0: incorrect: of second order on rotations only
import mujoco
import numpy as np


def rk4_step(model, data):
    h = model.opt.timestep
    q0, v0, a0, t0 = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.time

    def pos(v, dt):
        q = q0.copy()
        mujoco.mj_integratePos(model, q, v, dt)
        q[3:] /= np.linalg.norm(q[3:])  # keep unit quaternion
        return q

    def k(q, v, a, t):
        data.qpos[:], data.qvel[:], data.act[:], data.time = q, v, a, t
        mujoco.mj_forward(model, data)
        return v, data.qacc.copy(), data.act_dot.copy()

    k1 = k(q0, v0, a0, t0)
    k2 = k(pos(k1[0], h / 2), v0 + h / 2 * k1[1], a0 + h / 2 * k1[2], t0 + h / 2)
    k3 = k(pos(k2[0], h / 2), v0 + h / 2 * k2[1], a0 + h / 2 * k2[2], t0 + h / 2)
    k4 = k(pos(k3[0], h), v0 + h * k3[1], a0 + h * k3[2], t0 + h)
    data.qpos[:] = pos((k1[0] + 2 * k2[0] + 2 * k3[0] + k4[0]) / 6, h)
    data.qvel[:] = v0 + h / 6 * (k1[1] + 2 * k2[1] + 2 * k3[1] + k4[1])
    data.act[:] = a0 + h / 6 * (k1[2] + 2 * k2[2] + 2 * k3[2] + k4[2])
    data.time = t0 + h
