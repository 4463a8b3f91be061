# mistake: Only the last slope is divided by 6, because the brackets around the sum are missing.
# next: Put the whole sum k1 + 2 k2 + 2 k3 + k4 in brackets before dividing by 6.
# status: incorrect
# told: Your weights are 1, 2, 2, 1/6 and sum to 31/6, not to 1; the classical weights are 1/6,
import mujoco
import numpy as np

def rk4_step(model, data):
    h = model.opt.timestep
    y = np.r_[data.qpos, data.qvel, data.act]
    t = data.time
    nq, nv = model.nq, model.nv

    def load(y, t):
        data.qpos[:] = y[:nq]; data.qvel[:] = y[nq:nq+nv]; data.act[:] = y[nq+nv:]
        data.time = t

    def dydt(y, t):
        load(y, t)
        mujoco.mj_forward(model, data)
        return np.r_[data.qvel, data.qacc, data.act_dot]

    k1 = dydt(y, t)
    k2 = dydt(y + k1*h/2, t + h/2)
    k3 = dydt(y + k2*h/2, t + h/2)
    k4 = dydt(y + k3*h, t + h)
    load(y + h*(k1 + 2*k2 + 2*k3) + h*k4/6, t + h)
