"""Largest stable timestep of the servo-held pendulum, by bisection.

What is here runs, but finds nothing: it only looks at both ends of the search.
The comments say what is missing.
Try it on your own machine first:  python servo_threshold.py
"""

import mujoco
from mjcourse import model_path

SHORTEST, LONGEST = 0.001, 0.050  # where to search, in s
WIDTH = 0.0005  # how narrow the answer has to be, in s
SECONDS = 3.0  # how long a run lasts


def is_stable(model, integrator, timestep):
    """Does the pendulum, let go at 1 rad, stay stable for SECONDS?"""
    model.opt.integrator = integrator
    model.opt.timestep = timestep
    data = mujoco.MjData(model)
    # 1. Let the run start at 1 rad: data.qpos[0] = ...
    # 2. Step to SECONDS. When MuJoCo finds a huge or NaN value it raises a warning and RESETS the state, so the state
    #    at the end of the run tells you nothing. Look at data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number
    #    (and at BADQPOS, BADQVEL), or watch for data.time running backwards.
    return True


def largest_stable_timestep(model, integrator):
    """Return (h_stable, h_unstable) in seconds, or None where nothing up to LONGEST is unstable.

    model: a compiled pendulum_servo; its gains, mass and length change from call to call: use the one you are given.
    integrator: an int, such as int(mujoco.mjtIntegrator.mjINT_EULER).
    """
    if is_stable(model, integrator, LONGEST):
        return None
    low, high = SHORTEST, LONGEST  # stable at low, unstable at high
    # 3. Halve the interval until it is no wider than WIDTH, and keep "stable at low, unstable at high" true.
    return low, high


if __name__ == "__main__":
    servo = mujoco.MjModel.from_xml_path(str(model_path("pendulum_servo")))
    servo.actuator_gainprm[0, 0], servo.actuator_biasprm[0, 1] = 2000, -2000  # kp
    servo.actuator_biasprm[0, 2] = -5  # kv
    for name in ("EULER", "IMPLICITFAST", "DISCRETE"):
        code = int(getattr(mujoco.mjtIntegrator, f"mjINT_{name}"))
        print(f"{name:<13s}", largest_stable_timestep(servo, code))
