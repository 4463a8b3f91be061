"""Measures what an episode achieved: one number for each goal, in the units of its sensor or of the controls."""

from collections.abc import Callable, Mapping
from math import ceil, comb, inf, sqrt

import numpy as np
from numpy.typing import NDArray

from grader.exercises.episodes.parameters import Goal, GoalName, Problem
from grader.exercises.episodes.simulating import Floats, Mask, Record
from grader.numerics.shares import bound_share

OFTEN = 0.1
"""The share of time at each of both ends from which on a control may switch between them."""

CHANGES_MIN = 6
"""The fewest changes from one end to the other that are called switching."""


def measure_goal(goal: Goal, record: Record) -> float:
    """Returns the measure of a goal. Where the episode did not reach its end, or nothing is left to measure, it is inf,
    or -inf for a goal with a least value; a return counts up to where the author's program ends the episode."""
    worst = inf if goal.min is None else -inf
    if record.fault is not None or record.lost_at_s is not None or not len(record.time_s):
        return worst
    if record.is_over and goal.goal != "return":
        return worst
    later = record.time_s >= goal.from_s - 1e-9
    return MEASURES[goal.goal](goal, record, later) if later.any() else worst


def meets(goal: Goal, measured: float) -> bool:
    """Whether a measure is within the goal."""
    if goal.min is not None:
        return measured >= goal.min
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


def measure_return(goal: Goal, record: Record, later: Mask) -> float:
    """The sum of the author's rewards."""
    return float(record.rewards[later].sum())


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
    "return": measure_return,
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
    "return": "return",
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
    "return": "Its return, the sum of the rewards, is too small.",
}

FAILED_SENSOR: Mapping[GoalName, str] = dict(FAILED) | {
    "rms": "On the whole {} stays too far from the target.",
    "error": "At some moment {} is too far from the target.",
    "range": "The sensor {} leaves the range that is allowed.",
}
"""The same of a goal with a sensor of its own."""


def bound_success(passed: int, simulated: int, episodes: int, share: float) -> float:
    """Returns an upper bound of the chance that a law succeeds in a share of some episodes, drawn independently, of
    which it has `passed` this many of those `simulated`. The chance of one is bounded by Wilson's interval."""
    if passed == simulated:
        return 1.0
    _, chance = bound_share(passed, simulated)
    needed = ceil(share * episodes - 1e-9)
    return sum(comb(episodes, n) * chance**n * (1 - chance) ** (episodes - n) for n in range(needed, episodes + 1))


def measure_saturation(problem: Problem, record: Record) -> float:
    """Returns the share of time in which the controls are at or beyond an actuator's limit."""
    model = problem.model
    low, high = model.actuator_ctrlrange.T
    beyond = (record.asked >= high) | (record.asked <= low)
    return float(np.mean((beyond & model.actuator_ctrllimited.astype(bool)).any(axis=1)))


def switches_ends(problem: Problem, record: Record) -> bool:
    """Whether the controls go from one limit of an actuator to the other CHANGES_MIN times or more, and are at or
    beyond each for a share OFTEN of the time."""
    model = problem.model
    low, high = model.actuator_ctrlrange.T
    ends = np.where(record.asked >= high, 1, np.where(record.asked <= low, -1, 0))
    return any(
        is_limited and min(np.mean(end < 0), np.mean(end > 0)) >= OFTEN and count_changes(end) >= CHANGES_MIN
        for end, is_limited in zip(ends.T, model.actuator_ctrllimited, strict=True)
    )


def count_changes(ends: NDArray[np.int_]) -> int:
    """Returns how often a row of -1, 0 and 1 goes from one end to the other."""
    return int(np.count_nonzero(np.diff(ends[ends != 0])))
