"""Let an arm ring down. What is here runs, but measures nothing.

Try it on your own machine first:  python ring.py
"""

import mujoco
from mjcourse import model_path


def ring(model, data):
    """Return decay rate [1/s], settling time [s] and the angle after 500 steps [rad], from the state of `data`."""
    # 1. The peaks fall like exp(-rate * t): fit a line to their logarithm.
    # 2. The last time outside of the band is where it settles.
    return {"rate": 0.0, "settled": 0.0, "angle": 0.0}


if __name__ == "__main__":
    arm = mujoco.MjModel.from_xml_path(str(model_path("servo_arm")))
    state = mujoco.MjData(arm)
    state.qpos[0] = 0.4
    print(ring(arm, state))
