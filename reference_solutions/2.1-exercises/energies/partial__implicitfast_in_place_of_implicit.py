# diagnosis: as implicitfast and discrete here
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
    start = np.concatenate([data.qpos, data.qvel])
    res = {}
    for name in ("euler", "implicit"):
        with integrator(model, getattr(mujoco.mjtIntegrator, {"euler": "mjINT_EULER", "implicit": "mjINT_IMPLICITFAST"}[name])):
            d = mujoco.MjData(model)
            d.qpos[:], d.qvel[:] = np.split(start, [model.nq])
            lo, hi = np.inf, -np.inf
            for _ in range(1500):
                mujoco.mj_step1(model, d)
                mujoco.mj_step2(model, d)
                mujoco.mj_forward(model, d)
                e = sum(d.energy)
                lo, hi = min(lo, e), max(hi, e)
            res[name] = hi - lo
    return res
