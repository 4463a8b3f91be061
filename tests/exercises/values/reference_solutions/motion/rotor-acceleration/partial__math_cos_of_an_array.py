# diagnosis: math.sin and its like take one number
import math

import numpy as np


def acceleration(model, data):
    mass, length = model.body_mass[1], -model.body_ipos[1, 2]
    inertia = mass * length**2 + model.body_inertia[1, 1] + model.dof_armature[0]
    gravity = -mass * 9.81 * length * np.sin(data.qpos[0])
    return (gravity - model.dof_damping[0] * data.qvel[0] + data.ctrl[0]) / inertia


def energy(angle, velocity, inertia):
    return inertia * velocity**2 / 2 + 9.81 * 0.5 * (1 - math.cos(angle))
