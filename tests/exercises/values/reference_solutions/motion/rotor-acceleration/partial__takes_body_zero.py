# diagnosis: Your results are those of bodies without mass: body 0 is the world
import numpy as np


def acceleration(model, data):
    mass, length = model.body_mass[0], -model.body_ipos[0, 2]
    inertia = mass * length**2 + model.body_inertia[0, 1] + model.dof_armature[0]
    gravity = -mass * 9.81 * length * np.sin(data.qpos[0])
    return (gravity - model.dof_damping[0] * data.qvel[0] + data.ctrl[0]) / inertia


def energy(angle, velocity, inertia):
    return inertia * velocity**2 / 2 + 9.81 * 0.5 * (1 - np.cos(angle))
