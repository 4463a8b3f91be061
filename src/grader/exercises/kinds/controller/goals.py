"""Measures what an episode achieved: one number for each goal, in the units of its sensor or of the controls."""

from collections.abc import Callable, Mapping
from math import inf, sqrt

import numpy as np

from grader.exercises.kinds.controller.parameters import Goal, GoalName
from grader.exercises.kinds.controller.simulating import Floats, Mask, Record

Z = 1.959963984540054
"""The 97.5 % quantile of the normal distribution: intervals of 95 %."""


def measure_goal(goal: Goal, record: Record) -> float:
    """Returns the measure of a goal; inf where the episode did not reach its end, or nothing is left to measure."""
    if record.fault is not None or record.lost_at_s is not None or not len(record.time_s):
        return inf
    later = record.time_s >= goal.from_s - 1e-9
    return MEASURES[goal.goal](goal, record, later) if later.any() else inf


def meets(goal: Goal, measured: float) -> bool:
    """Whether a measure is within the goal."""
    return measured <= (0.0 if goal.max is None else goal.max)


def read_sensor(goal: Goal, record: Record) -> Floats:
    """Returns what a goal is about: its sensor, by default the tracked one."""
    return record.sensors[goal.sensor] if goal.sensor else record.tracked


def measure_rms(goal: Goal, record: Record, later: Mask) -> float:
    """The root of the mean square of the error."""
    return sqrt(float(np.mean((record.tracked - record.target)[later] ** 2)))


def measure_error(goal: Goal, record: Record, later: Mask) -> float:
    """The largest error."""
    return float(np.abs((record.tracked - record.target)[later]).max())


def measure_overshoot(goal: Goal, record: Record, later: Mask) -> float:
    """How far the sensor passes the last target, on the side away from where it was when that was set."""
    since = find_last_target(record)
    error = (record.tracked - record.target)[since:]
    return max(0.0, float((-np.sign(error[0]) * error)[later[since:]].max(initial=0.0)))


def measure_settling(goal: Goal, record: Record, later: Mask) -> float:
    """The time from the last target on until the error stays within the band [s]; inf if it does not."""
    assert goal.band is not None
    since = find_last_target(record)
    outside = np.flatnonzero(np.abs(record.tracked - record.target)[since:] > goal.band)
    if not len(outside):
        return 0.0
    settled = since + int(outside[-1]) + 1
    return float(record.time_s[settled] - record.time_s[since]) if settled < len(record.time_s) else inf


def measure_effort(goal: Goal, record: Record, later: Mask) -> float:
    """The root of the mean square of the controls that acted."""
    return sqrt(float(np.mean(np.sum(record.applied[later] ** 2, axis=1))))


def measure_energy(goal: Goal, record: Record, later: Mask) -> float:
    """The mechanical work of the actuators, without regard to its direction [J]."""
    period_s = float(record.time_s[1] - record.time_s[0]) if len(record.time_s) > 1 else 0.0
    return float(record.power_w[later].sum() * period_s)


def measure_chatter(goal: Goal, record: Record, later: Mask) -> float:
    """The mean change of the controls from one period to the next."""
    changes = np.abs(np.diff(record.applied[later], axis=0))
    return float(changes.sum(axis=1).mean()) if len(changes) else 0.0


def measure_range(goal: Goal, record: Record, later: Mask) -> float:
    """How far the sensor leaves its range; 0 where it stays within."""
    assert goal.within is not None
    values = read_sensor(goal, record)[later]
    return max(0.0, float(goal.within.low - values.min()), float(values.max() - goal.within.high))


def find_last_target(record: Record) -> int:
    """Returns the index at which the last target was set."""
    changes = np.flatnonzero(np.diff(record.target))
    return int(changes[-1]) + 1 if len(changes) else 0


Measure = Callable[[Goal, Record, Mask], float]
MEASURES: Mapping[GoalName, Measure] = {
    "rms": measure_rms,
    "error": measure_error,
    "overshoot": measure_overshoot,
    "settling": measure_settling,
    "effort": measure_effort,
    "energy": measure_energy,
    "chatter": measure_chatter,
    "range": measure_range,
}

TITLES: Mapping[GoalName, str] = {
    "rms": "mean error",
    "error": "largest error",
    "overshoot": "overshoot",
    "settling": "settling time",
    "effort": "effort",
    "energy": "energy",
    "chatter": "chatter",
    "range": "limits",
}

FAILED: Mapping[GoalName, str] = {
    "rms": "On the whole it stays too far from the target.",
    "error": "At some moment it is too far from the target.",
    "overshoot": "It overshoots the target too far.",
    "settling": "It does not settle at the target soon enough.",
    "effort": "It takes too much control.",
    "energy": "It takes too much energy.",
    "chatter": "The controls jump too much from one step to the next.",
    "range": "It leaves the range that is allowed.",
}


def bound_share(successes: int, episodes: int) -> tuple[float, float]:
    """Returns the 95 % interval of a share of successes. Source: Wilson, J. Am. Stat. Assoc. 22 (1927) 209."""
    share = successes / episodes
    middle = (share + Z**2 / (2 * episodes)) / (1 + Z**2 / episodes)
    half = Z * sqrt(share * (1 - share) / episodes + Z**2 / (4 * episodes**2)) / (1 + Z**2 / episodes)
    return max(0.0, min(share, middle - half)), min(1.0, max(share, middle + half))
