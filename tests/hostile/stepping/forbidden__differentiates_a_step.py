"""Derivatives of a step by finite differences, which steps for them."""

import mujoco
import numpy as np


def step(model, data):
    n = 2 * model.nv + model.na
    mujoco.mjd_transitionFD(model, data, 1e-6, True, np.zeros((n, n)), None, None, None)
