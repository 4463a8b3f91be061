# mistake: kv is read from actuator_biasprm as it stands there, -kv, so the damper has the wrong sign in the formula.
# next: Take kv = -model.actuator_biasprm[0, 2].
# status: incorrect
# told: Your limits under Euler and under implicitfast are exchanged
import math


def largest_stable_timestep(model, integrator):
    kp = model.actuator_gainprm[0][0]
    kv = model.actuator_biasprm[0][2]
    m = model.body_mass[1]
    l = -model.body_ipos[1][2]
    g = -model.opt.gravity[2]
    inertia = m * l * l + model.body_inertia[1][1]
    k = kp + m * g * l
    root = math.sqrt(kv * kv + 4 * inertia * k)
    if integrator == 0:
        h = (root - kv) / k
    elif integrator == 3:
        h = (root + kv) / k
    else:
        return None
    if h > 0.05:
        return None
    return h - 0.0002, h + 0.0002
