# mistake: The quaternion is taken from qpos[3:7] whatever the model, so only a single free joint works.
# next: Find quaternions by model.jnt_type, model.jnt_qposadr and model.jnt_dofadr, or leave them to mj_integratePos.
# status: partial
# told: hidden case 2: TypeError, in line 11 of your
# told from MuJoCo 4.0.0: incorrect: of second order on rotations only
import mujoco
import numpy as np


def integrate_pos(qpos, qvel, dt):
    q = qpos.copy()
    q[0:3] += dt * qvel[0:3]
    mujoco.mju_quatIntegrate(q[3:7], qvel[3:6], dt)
    q[7:] += dt * qvel[6:]
    return q


def rk4_step(model, data):
    h = model.opt.timestep
    q, v, act, t = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.time
    vel, acc, rate = [], [], []
    for c in (0, h / 2, h / 2, h):
        if vel:
            data.qpos[:] = integrate_pos(q, vel[-1], c)
            data.qvel[:] = v + c * acc[-1]
            data.act[:] = act + c * rate[-1]
        data.time = t + c
        mujoco.mj_forward(model, data)
        vel.append(data.qvel.copy())
        acc.append(data.qacc.copy())
        rate.append(data.act_dot.copy())
    data.qpos[:] = integrate_pos(q, (vel[0] + 2 * vel[1] + 2 * vel[2] + vel[3]) / 6, h)
    data.qvel[:] = v + h * (acc[0] + 2 * acc[1] + 2 * acc[2] + acc[3]) / 6
    data.act[:] = act + h * (rate[0] + 2 * rate[1] + 2 * rate[2] + rate[3]) / 6
    data.time = t + h
