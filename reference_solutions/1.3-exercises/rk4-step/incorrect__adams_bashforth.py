# diagnosis: You call mj_forward once; use four slopes of this step
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

LAST = None

def rk4_step(model, data):
    h = model.opt.timestep
    t = data.time
    y = np.concatenate([data.qpos, data.qvel, data.act])
    k1 = deriv(model, data, y, t)
    global LAST
    y = y + h*(1.5*k1 - 0.5*(LAST if LAST is not None else k1))
    LAST = k1
    data.qpos[:] = y[:model.nq]
    data.qvel[:] = y[model.nq:model.nq+model.nv]
    data.act[:] = y[model.nq+model.nv:]
    data.time = t + h
