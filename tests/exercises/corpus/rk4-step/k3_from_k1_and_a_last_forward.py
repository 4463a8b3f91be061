# mistake: The third slope starts with k1; a last mj_forward, for whoever reads data.qacc next, is no mistake.
# next: Reach k3 with k2.
# status: incorrect
# told: Your stage 3 uses the first slope again: it moves by h/2 k1, not by h/2
import mujoco
import numpy as np

def rk4_step(model, data):
    h = model.opt.timestep
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
    k3 = f(q + h/2*k1[0], v + h/2*k1[1], a + h/2*k1[2], t + h/2)
    k4 = f(q + h*k3[0], v + h*k3[1], a + h*k3[2], t + h)
    data.qpos[:] = q + h/6*(k1[0] + 2*k2[0] + 2*k3[0] + k4[0])
    data.qvel[:] = v + h/6*(k1[1] + 2*k2[1] + 2*k3[1] + k4[1])
    data.act[:] = a + h/6*(k1[2] + 2*k2[2] + 2*k3[2] + k4[2])
    data.time = t + h
    mujoco.mj_forward(model, data)
