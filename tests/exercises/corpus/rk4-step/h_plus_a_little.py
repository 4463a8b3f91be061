# mistake: A small number is added to h.
# next: Take h = model.opt.timestep as it is.
# status: incorrect
# told: Your h is 1e-09 s longer than model.opt.timestep
import mujoco, numpy as np
def rk4_step(model, data):
    h = model.opt.timestep+1e-9
    t = data.time
    q, v, w = data.qpos.copy(), data.qvel.copy(), data.act.copy()
    def f(q, v, w, t):
        data.qpos[:] = q; data.qvel[:] = v; data.act[:] = w; data.time = t
        mujoco.mj_forward(model, data)
        return v.copy(), data.qacc.copy(), data.act_dot.copy()
    k1 = f(q, v, w, t)
    k2 = f(q + h/2*k1[0], v + h/2*k1[1], w + h/2*k1[2], t + h/2)
    k3 = f(q + h/2*k2[0], v + h/2*k2[1], w + h/2*k2[2], t + h/2)
    k4 = f(q + h*k3[0], v + h*k3[1], w + h*k3[2], t + h)
    data.qpos[:] = q + h/6*(k1[0] + 2*k2[0] + 2*k3[0] + k4[0])
    data.qvel[:] = v + h/6*(k1[1] + 2*k2[1] + 2*k3[1] + k4[1])
    data.act[:] = w + h/6*(k1[2] + 2*k2[2] + 2*k3[2] + k4[2])
    data.time = t + h
