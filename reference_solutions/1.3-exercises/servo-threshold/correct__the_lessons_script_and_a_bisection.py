"""Lesson 1.3: the largest stable timestep, from the lesson's own script.

INPUT   a compiled pendulum_servo
PROCESS bisection of the timestep around the lesson's servo_is_stable
OUTPUT  the last stable and the first unstable timestep found
"""

import mujoco

from mjcourse import model_path

INTEGRATORS = {"Euler": 0, "RK4": 1, "implicit": 2, "implicitfast": 3, "discrete": 4}


def servo_is_stable(model, integrator: int, timestep: float, seconds: float = 3.0) -> bool:
    model.opt.integrator, model.opt.timestep = integrator, timestep
    data = mujoco.MjData(model)
    data.qpos[0] = 1.0
    while data.time < seconds:
        mujoco.mj_step(model, data)
    return data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number == 0


def largest_stable_timestep(model, integrator):
    stable, unstable = 0.001, 0.05
    if servo_is_stable(model, integrator, unstable):
        return None
    while unstable - stable > 0.0005:
        middle = (stable + unstable) / 2
        if servo_is_stable(model, integrator, middle):
            stable = middle
        else:
            unstable = middle
    return stable, unstable


if __name__ == "__main__":
    model = mujoco.MjModel.from_xml_path(str(model_path("pendulum_servo")))
    for name, code in INTEGRATORS.items():
        print(name, largest_stable_timestep(model, code))
