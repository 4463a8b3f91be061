"""Measure the period of a pendulum from several angles. What is here runs, but measures nothing.

Try it on your own machine first:  python amplitudes.py
"""

import mujoco
import numpy as np
from mjcourse import model_path


def periods(model, data, x):
    """Return the period [s] from each of the angles `x` [rad], as {"period": [...]}."""
    # For each angle: put the pendulum there, at rest, and time its swing.
    return {"period": np.zeros(len(x))}


if __name__ == "__main__":
    pendulum = mujoco.MjModel.from_xml_path(str(model_path("pendulum")))
    print(periods(pendulum, mujoco.MjData(pendulum), np.array([0.5, 1.5, 2.5])))
