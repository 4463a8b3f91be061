"""A named tuple in an order of its own, with a fraction among its numbers."""

from fractions import Fraction
from typing import NamedTuple

import mujoco
import numpy as np


class Swing(NamedTuple):
    frequency: Fraction
    period: float
    speed: float


def swing(model, data):
    times, angles, speeds = [], [], []
    while data.time < 8:
        times.append(data.time)
        angles.append(data.qpos[0])
        speeds.append(data.qvel[0])
        mujoco.mj_step(model, data)
    t, a = np.array(times), np.array(angles)
    before = np.flatnonzero((a[:-1] < 0) & (a[1:] >= 0))
    upward = t[before] - a[before] * (t[before + 1] - t[before]) / (a[before + 1] - a[before])
    period = float(upward[-1] - upward[0]) / (len(upward) - 1)
    return Swing(period=period, frequency=Fraction(1 / period), speed=np.abs(speeds).max())
