# mistake: The eigenvalues of one step are complex, and only their real parts are compared with 1; their absolute values decide.
# next: Use np.abs(eigenvalues).max() > 1.
# status: incorrect
# told: its eigenvalues are complex, and the motion grows where the absolute value
import numpy as np
import mujoco


def transition(model, h):
    model.opt.timestep = h
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    A = np.zeros((2 * model.nv + model.na, 2 * model.nv + model.na))
    mujoco.mjd_transitionFD(model, data, 1e-6, True, A, None, None, None)
    return A


def largest_stable_timestep(model, integrator):
    model.opt.integrator = integrator

    def unstable(h):
        eigenvalues = np.linalg.eigvals(transition(model, h))
        return eigenvalues.real.max() > 1.0

    if not unstable(0.05):
        return None
    a, b = 0.001, 0.05
    while b - a > 1e-4:
        c = (a + b) / 2
        a, b = (a, c) if unstable(c) else (c, b)
    return float(a), float(b)
