# mistake: qvel is padded with zeros to the length of qpos so that they can be added; quaternions are not angles.
# next: Use mj_integratePos.
# status: incorrect
# told: Your velocities are added to data.qpos number by number
import mujoco
import numpy as np


def rk4_step(model, data):
    h = model.opt.timestep
    nq, nv = model.nq, model.nv
    pad = lambda v: np.pad(v, (0, nq - nv))
    q, v, w, t = np.array(data.qpos), np.array(data.qvel), np.array(data.act), data.time

    def f(q_, v_, w_, t_):
        data.qpos[:] = q_
        data.qvel[:] = v_
        data.act[:] = w_
        data.time = t_
        mujoco.mj_normalizeQuat(model, data.qpos)
        mujoco.mj_forward(model, data)
        return pad(v_), data.qacc.copy(), data.act_dot.copy()

    a = f(q, v, w, t)
    b = f(q + h / 2 * a[0], v + h / 2 * a[1], w + h / 2 * a[2], t + h / 2)
    c = f(q + h / 2 * b[0], v + h / 2 * b[1], w + h / 2 * b[2], t + h / 2)
    d = f(q + h * c[0], v + h * c[1], w + h * c[2], t + h)
    data.qpos[:] = q + h / 6 * (a[0] + 2 * b[0] + 2 * c[0] + d[0])
    mujoco.mj_normalizeQuat(model, data.qpos)
    data.qvel[:] = v + h / 6 * (a[1] + 2 * b[1] + 2 * c[1] + d[1])
    data.act[:] = w + h / 6 * (a[2] + 2 * b[2] + 2 * c[2] + d[2])
    data.time = t + h
