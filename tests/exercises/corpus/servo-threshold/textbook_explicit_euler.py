# mistake: The textbook's limit of explicit Euler, |1 + h lambda| < 1, is used; MuJoCo's Euler updates positions with the new velocity, so its limit is another one.
# next: Simulate the given model; MuJoCo's Euler is semi-implicit.
# status: incorrect
# told: Nothing was simulated: your answer comes from a formula
import numpy as np


def largest_stable_timestep(model, integrator):
    """Stability of x' = A x under Euler: |1 + h*lambda| < 1  =>  h < -2 Re(lambda)/|lambda|^2."""
    if integrator != 0:
        return None  # implicit methods are A-stable
    kp = model.actuator_gainprm[0, 0]
    kv = -model.actuator_biasprm[0, 2]
    m = model.body_mass[1]
    L = abs(model.body_ipos[1, 2])
    I = m * L**2 + model.body_inertia[1, 1]
    A = np.array([[0, 1], [-(kp + m * 9.81 * L) / I, -kv / I]])
    lam = np.linalg.eigvals(A)
    h = min(-2 * lam.real / np.abs(lam) ** 2)
    return h - 0.0001, h + 0.0001
