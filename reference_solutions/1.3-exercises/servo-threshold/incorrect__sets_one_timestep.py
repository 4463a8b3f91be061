# diagnosis: to one number alone
import mujoco
import numpy as np

class Blew(Exception):
    pass

def _try(model, integ, h):
    model.opt.integrator = integ
    model.opt.timestep = 0.002
    d = mujoco.MjData(model)
    d.joint("hinge").qpos[0] = 1.0
    last = 0.0
    while d.time < 3.0:
        mujoco.mj_step(model, d)
        if d.time <= last:
            raise Blew(h)
        last = d.time

def largest_stable_timestep(model, integrator):
    grid = np.arange(1, 101) * 5e-4
    def bad(h):
        try:
            _try(model, integrator, h)
        except Blew:
            return True
        return False
    if not bad(0.05):
        return None
    # recursion
    def search(a, b):
        if b - a <= 5e-4:
            return (a, b)
        m = 0.5 * (a + b)
        return search(a, m) if bad(m) else search(m, b)
    return search(0.001, 0.05)
