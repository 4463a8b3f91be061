# mistake: Sets the model's damping to 0, which the visible model has anyway.
# next: Leave the model as it is.
# status: partial
# told: Your step changes the model that it is given: model.dof_damping is
import mujoco
import numpy as np

def rk4_step(model, data):
    model.dof_damping[:] = 0  # no friction
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
    k3 = f(q + h/2*k2[0], v + h/2*k2[1], a + h/2*k2[2], t + h/2)
    k4 = f(q + h*k3[0], v + h*k3[1], a + h*k3[2], t + h)
    data.qpos[:] = q + h/6*(k1[0] + 2*k2[0] + 2*k3[0] + k4[0])
    data.qvel[:] = v + h/6*(k1[1] + 2*k2[1] + 2*k3[1] + k4[1])
    data.act[:] = a + h/6*(k1[2] + 2*k2[2] + 2*k3[2] + k4[2])
    data.time = t + h
