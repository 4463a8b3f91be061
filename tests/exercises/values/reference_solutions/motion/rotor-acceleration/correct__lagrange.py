import math


def acceleration(model, data):
    m, l, g = float(model.body_mass[1]), abs(float(model.body_ipos[1][2])), 9.81
    turning = m * l * l + float(model.body_inertia[1][1])
    torque = float(data.ctrl[0]) - m * g * l * math.sin(data.qpos[0]) - 0.03 * float(data.qvel[0])
    return torque / (turning + float(model.dof_armature[0]))


def energy(angle, velocity, inertia):
    return [0.5 * inertia * v * v + 9.81 * 0.5 * (1 - math.cos(a)) for a, v in zip(angle, velocity)]
