# mistake: The file is a notebook export that still has a line of notebook magic in it, which is not Python.
# next: Delete the lines that begin with % or !.
# status: crashed
# told: SyntaxError: invalid
# In[1]:
%matplotlib inline
!pip install mujoco
import mujoco
import numpy as np

# In[2]:
def rk4_step(model, data):
    h = model.opt.timestep
    q, v = data.qpos.copy(), data.qvel.copy()
    def f(q, v):
        data.qpos[:] = q
        data.qvel[:] = v
        mujoco.mj_forward(model, data)
        return v, data.qacc.copy()
    k1 = f(q, v)
    k2 = f(q + h/2*k1[0], v + h/2*k1[1])
    k3 = f(q + h/2*k2[0], v + h/2*k2[1])
    k4 = f(q + h*k3[0], v + h*k3[1])
    data.qpos[:] = q + h/6*(k1[0] + 2*k2[0] + 2*k3[0] + k4[0])
    data.qvel[:] = v + h/6*(k1[1] + 2*k2[1] + 2*k3[1] + k4[1])
    data.time += h
