# mistake: It returns the lesson's bound 2 sqrt(I / kp) instead of simulating, so the damper and gravity are ignored.
# next: Simulate the given model at trial timesteps and bisect.
# status: incorrect
# told: You reported the bound 2*sqrt(I/kp), which ignores the damper: the servo's own damping
import math


def largest_stable_timestep(model, integrator):
    if integrator == 4:
        return None
    m = model.body_mass[1]
    L = abs(model.body_ipos[1][2])
    I = m * L**2 + model.body_inertia[1][1]
    kp = model.actuator_gainprm[0, 0]
    h = 2 * math.sqrt(I / kp)
    return h if h < 0.05 else None
