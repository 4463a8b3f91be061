# mistake: You wait for NaN, but MuJoCo resets the state before you can see one.
# next: Look at the warnings, or at the time falling back.
# status: incorrect
# told: At 50 ms MuJoCo raised BADQACC and reset the state, and your answer calls that timestep
import mujoco as mj
import numpy as np

# week 3, exercise 1
def blowsUp(m, integ, h):
    m.opt.timestep = h
    m.opt.integrator = integ
    d = mj.MjData(m)
    mj.mj_resetData(m, d)
    d.qpos[0] = 1.0
    d.qvel[0] = 0.0
    d.ctrl[0] = 0.0
    n = int(np.ceil(3.0 / h))
    for i in range(n):
        mj.mj_step(m, d)
    return np.isnan(d.qpos).any() or np.isnan(d.qvel).any()

def largest_stable_timestep(model, integrator):
    a = 0.001   # ok
    b = 0.05    # not ok
    if not blowsUp(model, integrator, b):
        return None
    while (b - a) > 0.0004:
        c = 0.5 * (a + b)
        if blowsUp(model, integrator, c):
            b = c
        else:
            a = c
    return (a, b)
