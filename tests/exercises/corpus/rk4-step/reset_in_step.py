# mistake: mj_resetData at the start of each step throws the state away.
# next: Leave the reset out.
# status: incorrect
# told: Wherever data stands, your step begins at the model's first pose at rest: the state is thrown
import mujoco as mj
import numpy as np

def f(model, data, x, t):
    """slope of the state x = [q, v, act] at time t"""
    nq = model.nq
    nv = model.nv
    data.qpos[:] = x[:nq]
    data.qvel[:] = x[nq:nq+nv]
    data.act[:] = x[nq+nv:]
    data.time = t
    mj.mj_forward(model, data)
    return np.concatenate([data.qvel, data.qacc, data.act_dot])

def rk4_step(model, data):
    mj.mj_resetData(model, data)
    dt = model.opt.timestep
    t0 = data.time
    x0 = np.concatenate([data.qpos, data.qvel, data.act])
    k1 = f(model, data, x0, t0)
    k2 = f(model, data, x0 + 0.5*dt*k1, t0 + 0.5*dt)
    k3 = f(model, data, x0 + 0.5*dt*k2, t0 + 0.5*dt)
    k4 = f(model, data, x0 + dt*k3, t0 + dt)
    x1 = x0 + dt*(k1 + 2*k2 + 2*k3 + k4)/6
    data.qpos[:] = x1[:model.nq]
    data.qvel[:] = x1[model.nq:model.nq+model.nv]
    data.act[:] = x1[model.nq+model.nv:]
    data.time = t0 + dt
