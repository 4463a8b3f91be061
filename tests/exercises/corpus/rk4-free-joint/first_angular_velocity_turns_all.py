# mistake: The quaternion's rate uses the angular velocity of the start of the step at every stage.
# next: Use the angular velocity of the stage.
# status: incorrect
# told: takes the angular velocity of the start of the step at every stage
import mujoco
import numpy as np


def qdot(model, q, v, v_start):
    rate = np.zeros(model.nq)
    for j in range(model.njnt):
        a, d, kind = model.jnt_qposadr[j], model.jnt_dofadr[j], model.jnt_type[j]
        if kind == 0:
            rate[a : a + 3] = v[d : d + 3]
            a, d = a + 3, d + 3
        if kind <= 1:
            out = np.zeros(4)
            mujoco.mju_derivQuat(out, q[a : a + 4], v_start[d : d + 3])
            # mju_derivQuat turns from the left, in the world; do it from the right
            mujoco.mju_mulQuat(out, q[a : a + 4], np.r_[0, v_start[d : d + 3]])
            rate[a : a + 4] = out / 2
        else:
            rate[a] = v[d]
    return rate


def rk4_step(model, data):
    h = model.opt.timestep
    q0, v0, w0, t0 = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.time

    def f(q, v, w, t):
        data.qpos[:], data.qvel[:], data.act[:], data.time = q, v, w, t
        mujoco.mj_forward(model, data)
        return qdot(model, q, v, v0), data.qacc.copy(), data.act_dot.copy()

    k1 = f(q0, v0, w0, t0)
    k2 = f(q0 + h / 2 * k1[0], v0 + h / 2 * k1[1], w0 + h / 2 * k1[2], t0 + h / 2)
    k3 = f(q0 + h / 2 * k2[0], v0 + h / 2 * k2[1], w0 + h / 2 * k2[2], t0 + h / 2)
    k4 = f(q0 + h * k3[0], v0 + h * k3[1], w0 + h * k3[2], t0 + h)
    q, v, w = (
        x + h / 6 * (a + 2 * b + 2 * c + d) for x, a, b, c, d in zip((q0, v0, w0), k1, k2, k3, k4)
    )
    mujoco.mj_normalizeQuat(model, q)
    data.qpos[:], data.qvel[:], data.act[:], data.time = q, v, w, t0 + h
