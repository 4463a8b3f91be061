"""Time the swing of a pendulum. What is here runs, but measures nothing.

Try it on your own machine first:  python swing.py
"""

import mujoco
from mjcourse import model_path


def swing(model, data):
    """Return period [s], frequency [Hz] and largest speed [rad/s] of a swing from the state of `data`."""
    # 1. Step through a few swings, and keep time, angle and speed of each step.
    # 2. When does the angle pass 0? Every other time it comes from the same side.
    return {"period": 0.0, "frequency": 0.0, "speed": 0.0}


if __name__ == "__main__":
    pendulum = mujoco.MjModel.from_xml_path(str(model_path("pendulum")))
    state = mujoco.MjData(pendulum)
    state.qpos[0] = 2.0
    print(swing(pendulum, state))
