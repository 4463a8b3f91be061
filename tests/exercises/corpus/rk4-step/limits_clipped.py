# mistake: Positions are clipped to the joint range after the step, although the limit acts as a soft force in data.qacc.
# next: Remove the clipping; mj_forward already contains the limit.
# status: partial
# told: Your step sets a velocity to 0 that is not: MuJoCo does not, since a joint limit is a force
import mujoco
import numpy as np


def rk4_step(model, data):
    h = model.opt.timestep
    q, v, act, t = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.time

    def k(q_, v_, act_, t_):
        data.qpos[:], data.qvel[:], data.act[:], data.time = q_, v_, act_, t_
        mujoco.mj_forward(model, data)
        return np.array(data.qvel), np.array(data.qacc), np.array(data.act_dot)

    a = k(q, v, act, t)
    b = k(q + h / 2 * a[0], v + h / 2 * a[1], act + h / 2 * a[2], t + h / 2)
    c = k(q + h / 2 * b[0], v + h / 2 * b[1], act + h / 2 * b[2], t + h / 2)
    d = k(q + h * c[0], v + h * c[1], act + h * c[2], t + h)
    data.qpos[:] = q + h / 6 * (a[0] + 2 * b[0] + 2 * c[0] + d[0])
    data.qvel[:] = v + h / 6 * (a[1] + 2 * b[1] + 2 * c[1] + d[1])
    data.act[:] = act + h / 6 * (a[2] + 2 * b[2] + 2 * c[2] + d[2])
    data.time = t + h
    # respect joint limits
    for j in range(model.njnt):
        if model.jnt_limited[j]:
            lo, hi = model.jnt_range[j]
            i = model.jnt_qposadr[j]
            if not lo <= data.qpos[i] <= hi:
                data.qpos[i] = min(max(data.qpos[i], lo), hi)
                data.qvel[model.jnt_dofadr[j]] = 0
