# diagnosis: acceleration is rounded to 3 decimals
import numpy as np


def acceleration(model, data):
    mass, length = model.body_mass[1], -model.body_ipos[1, 2]
    inertia = mass * length**2 + model.body_inertia[1, 1] + model.dof_armature[0]
    gravity = -mass * 9.81 * length * np.sin(data.qpos[0])
    return round((gravity - model.dof_damping[0] * data.qvel[0] + data.ctrl[0]) / inertia, 3)


def energy(angle, velocity, inertia):
    return inertia * velocity**2 / 2 + 9.81 * 0.5 * (1 - np.cos(angle))
