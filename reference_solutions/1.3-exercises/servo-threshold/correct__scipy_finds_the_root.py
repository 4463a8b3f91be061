"""The timestep at which the spectral radius of one step passes 1, by SciPy's root finder."""

import mujoco
import numpy as np
from scipy.optimize import brentq


def excess(h, model, integrator):
    model.opt.integrator, model.opt.timestep = integrator, h
    data = mujoco.MjData(model)
    step = np.zeros((2, 2))
    mujoco.mjd_transitionFD(model, data, 1e-6, True, step, None, None, None)
    return np.abs(np.linalg.eigvals(step)).max() - 1


def largest_stable_timestep(model, integrator):
    if excess(0.05, model, integrator) < 0:
        return None
    limit = brentq(excess, 0.001, 0.05, args=(model, integrator), xtol=1e-6)
    return limit - 1e-4, limit + 1e-4
