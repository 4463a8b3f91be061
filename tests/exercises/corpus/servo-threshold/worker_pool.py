# mistake: The search starts processes of its own with multiprocessing, which the grader does not allow.
# next: Run the simulations one after the other in the function itself.
# status: forbidden
# told: Do without other processes, in line 26 of your script: none can be started here
from multiprocessing import Pool

import mujoco
import numpy as np


def job(args):
    model, integrator, h = args
    model.opt.integrator = integrator
    model.opt.timestep = h
    d = mujoco.MjData(model)
    d.qpos[0] = 1.0
    for _ in range(round(3 / h)):
        t = d.time
        mujoco.mj_step(model, d)
        if d.time < t:
            return False
    return True


def largest_stable_timestep(model, integrator):
    hs = np.arange(0.001, 0.0501, 0.0005)
    with Pool(8) as pool:
        ok = pool.map(job, [(model, integrator, float(h)) for h in hs])
    for i in range(1, len(hs)):
        if not ok[i]:
            return float(hs[i - 1]), float(hs[i])
    return None
