"""Shake a table, and push it. What is here runs, but measures nothing.

Try it on your own machine first:  python shaker.py
"""

import mujoco
from mjcourse import model_path


def shake(model, data):
    """Return amplitude [m], settling time [s] and place of rest (low, high) [m] of the joint `table`."""
    # 1. data.ctrl[0] = 8 * sin(6 * data.time) before each step; look after 6 s.
    # 2. From rest again: data.ctrl[0] = 12.
    return {"amplitude": 0.0, "settled": 0.0, "rest": (0.0, 0.0)}


if __name__ == "__main__":
    shaker = mujoco.MjModel.from_xml_path(str(model_path("shaker")))
    print(shake(shaker, mujoco.MjData(shaker)))
