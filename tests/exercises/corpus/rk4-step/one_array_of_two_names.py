# mistake: `dq = dv = np.zeros(...)` is one array with two names, so velocities and accelerations are summed into the same place.
# next: Make two arrays.
# status: incorrect
# told: their two sums are one array, as after dq = dv = np.zeros(...)
import mujoco
import numpy as np


def rk4_step(model, data):
    h = model.opt.timestep
    q0, v0, w0, t0 = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.time
    dq = dv = np.zeros(model.nv)
    dw = np.zeros(model.na)
    for fraction, weight in ((0.5, 1), (0.5, 2), (1.0, 2), (0.0, 1)):
        mujoco.mj_forward(model, data)
        kq, kv, kw = data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()
        dq += weight * kq
        dv += weight * kv
        dw += weight * kw
        data.qpos[:] = q0 + fraction * h * kq
        data.qvel[:] = v0 + fraction * h * kv
        data.act[:] = w0 + fraction * h * kw
        data.time = t0 + fraction * h
    data.qpos[:] = q0 + h / 6 * dq
    data.qvel[:] = v0 + h / 6 * dv
    data.act[:] = w0 + h / 6 * dw
    data.time = t0 + h
