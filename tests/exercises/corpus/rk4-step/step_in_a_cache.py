# mistake: functools.lru_cache around the step: model and data are the same objects in every call, so it runs once.
# next: Take away the cache.
# status: incorrect
# told: nothing in later ones: it keeps something from one call to the
import functools
import mujoco
import numpy as np

@functools.lru_cache(None)
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
    k3 = f(q + h/2*k2[0], v + h/2*k2[1], a + h/2*k2[2], t + h/2)
    k4 = f(q + h*k3[0], v + h*k3[1], a + h*k3[2], t + h)
    data.qpos[:] = q + h/6*(k1[0] + 2*k2[0] + 2*k3[0] + k4[0])
    data.qvel[:] = v + h/6*(k1[1] + 2*k2[1] + 2*k3[1] + k4[1])
    data.act[:] = a + h/6*(k1[2] + 2*k2[2] + 2*k3[2] + k4[2])
    data.time = t + h
