# diagnosis: the bound 2*sqrt(I/kp)
import mujoco
import numpy as np


def largest_stable_timestep(model, integrator):
    body = model.jnt_bodyid[0]
    inertia = model.body_mass[body] * model.body_ipos[body, 2] ** 2 + model.body_inertia[body, 0]  # m L^2 + I_c
    bound = 2 * np.sqrt(inertia / model.actuator_gainprm[0, 0])
    return bound - 0.0002, bound + 0.0002
