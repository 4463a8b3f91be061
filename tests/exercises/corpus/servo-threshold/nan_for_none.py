# mistake: Where nothing is unstable return None, not nan.
# next: Return None where nothing is unstable.
# status: partial
# told: Your function returns nan: where nothing is unstable return None alone
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
    W = mj.mjtWarning
    bad = d.warning[W.mjWARN_BADQPOS].number + d.warning[W.mjWARN_BADQVEL].number + d.warning[W.mjWARN_BADQACC].number
    return bad > 0

def largest_stable_timestep(model, integrator):
    a = 0.001   # ok
    b = 0.05    # not ok
    if not blowsUp(model, integrator, b):
        return float("nan")
    while (b - a) > 0.0004:
        c = 0.5 * (a + b)
        if blowsUp(model, integrator, c):
            b = c
        else:
            a = c
    return (a, b)
