import math

import numpy as np


def swing(model, data):
    """Closed forms: the agm gives the period, the energy the speed at the bottom."""
    length = -model.body_ipos[1, 2]
    inertia = model.body_mass[1] * length**2 + model.body_inertia[1, 1]
    torque = model.body_mass[1] * 9.81 * length
    start = data.qpos[0]
    a, b = 1.0, math.cos(start / 2)
    while abs(a - b) > 1e-14:
        a, b = (a + b) / 2, math.sqrt(a * b)
    period = 2 * math.pi * math.sqrt(inertia / torque) / a
    speed = np.sqrt(2 * torque * (1 - math.cos(start)) / inertia)
    return period, 1 / period, speed
