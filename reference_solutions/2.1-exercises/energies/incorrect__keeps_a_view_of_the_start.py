# diagnosis: that of a run from the model's own start
import mujoco
import numpy as np
from contextlib import contextmanager

@contextmanager
def integrator(model, which):
    old = model.opt.integrator
    model.opt.integrator = which
    try:
        yield
    finally:
        model.opt.integrator = old

def energies(model, data):
    model.opt.enableflags |= int(mujoco.mjtEnableBit.mjENBL_ENERGY)
    start = data.qpos
    res = {}
    for name in ("euler", "implicit"):
        with integrator(model, getattr(mujoco.mjtIntegrator, "mjINT_" + name.upper())):
            d = data; mujoco.mj_resetData(model, d)
            d.qpos[:] = start
            lo, hi = np.inf, -np.inf
            for _ in range(1500):
                mujoco.mj_step1(model, d)
                mujoco.mj_step2(model, d)
                mujoco.mj_forward(model, d)
                e = sum(d.energy)
                lo, hi = min(lo, e), max(hi, e)
            res[name] = hi - lo
    return res
