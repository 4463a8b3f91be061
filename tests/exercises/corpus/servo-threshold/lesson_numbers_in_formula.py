# mistake: The formula is filled with the lesson's inertia and gains, so it gives the same answer for every model.
# next: Measure the model that is given: its gains, mass and length change from call to call.
# status: partial
# told: The function gave the same answer for every model, although their limits
import math

import mujoco

I = 0.2501
KP = 2000.0
KV = 5.0
K = KP + 9.81 * 0.5


def largest_stable_timestep(model, integrator):
    if integrator == mujoco.mjtIntegrator.mjINT_EULER:
        return (math.sqrt(KV**2 + 4 * I * K) - KV) / K
    if integrator == mujoco.mjtIntegrator.mjINT_IMPLICITFAST:
        return (math.sqrt(KV**2 + 4 * I * K) + KV) / K
    return None
