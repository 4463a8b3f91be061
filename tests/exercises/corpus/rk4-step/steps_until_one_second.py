# mistake: A loop to 1 s within the step, so that the first call does all and later ones nothing.
# next: Take one step in a call.
# status: incorrect
# told: One call of your step moves data.time on by 500 timesteps
import mujoco
import numpy as np

def one(model, data, h):
    q, v, a, t = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.time
    def f(qs, vs, acts, ts):
        data.qpos[:] = qs
        data.qvel[:] = vs
        data.act[:] = acts
        data.time = ts
        mujoco.mj_forward(model, data)
        return data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()
    k1 = f(q, v, a, t)
    k2 = f(q + h/2*k1[0], v + h/2*k1[1], a + h/2*k1[2], t + h/2)
    k3 = f(q + h/2*k2[0], v + h/2*k2[1], a + h/2*k2[2], t + h/2)
    k4 = f(q + h*k3[0], v + h*k3[1], a + h*k3[2], t + h)
    data.qpos[:] = q + h/6*(k1[0] + 2*k2[0] + 2*k3[0] + k4[0])
    data.qvel[:] = v + h/6*(k1[1] + 2*k2[1] + 2*k3[1] + k4[1])
    data.act[:] = a + h/6*(k1[2] + 2*k2[2] + 2*k3[2] + k4[2])
    data.time = t + h

def rk4_step(model, data):
    while data.time < 1.0:
        one(model, data, model.opt.timestep)
