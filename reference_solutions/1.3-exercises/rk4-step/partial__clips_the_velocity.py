# diagnosis: Your step cuts velocities off at 5
import mujoco
import numpy as np

def deriv(model, data, y, t):
    nq, nv = model.nq, model.nv
    data.qpos[:] = y[:nq]
    data.qvel[:] = y[nq:nq+nv]
    data.act[:] = y[nq+nv:]
    data.time = t
    mujoco.mj_forward(model, data)
    return np.concatenate([data.qvel, data.qacc, data.act_dot])

def rk4_step(model, data):
    h = model.opt.timestep
    t = data.time
    y = np.concatenate([data.qpos, data.qvel, data.act])
    k1 = deriv(model, data, y, t)
    k2 = deriv(model, data, y + 0.5*h*k1, t + 0.5*h)
    k3 = deriv(model, data, y + 0.5*h*k2, t + 0.5*h)
    k4 = deriv(model, data, y + h*k3, t + h)
    y = y + h/6*(k1 + 2*k2 + 2*k3 + k4)
    data.qpos[:] = y[:model.nq]
    data.qvel[:] = y[model.nq:model.nq+model.nv]
    data.qvel[:] = np.clip(data.qvel, -5, 5)
    data.act[:] = y[model.nq+model.nv:]
    data.time = t + h
