"""The optimal gains of the linearised model that is given, which is not quite the one that is simulated."""

import mujoco
import numpy as np
from scipy.linalg import solve_discrete_are


def make(model):
    model.opt.timestep = 0.01
    data = mujoco.MjData(model)
    a, b = np.zeros((4, 4)), np.zeros((4, 1))
    mujoco.mjd_transitionFD(model, data, 1e-6, True, a, b, None, None)
    q, r = np.diag([1.0, 10.0, 1.0, 1.0]), np.array([[0.05]])
    p = solve_discrete_are(a, b, q, r)
    gains = np.linalg.solve(r + b.T @ p @ b, b.T @ p @ a)

    def act(t, observation):
        return -(gains @ observation)

    return act
