"""Distances between runs, and the order at which they shrink."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from typing import Protocol

import mujoco
import numpy as np
from scipy import special  # scipy.stats would double the time that the command line takes to start

from grader.numerics.rollout import simulate
from grader.numerics.scene import Scene, Vector
from grader.numerics.stepping import Stepper

TIME_SLACK_S = 1e-9
"""Sums of timesteps drift by rounding; times farther apart than this are different times."""


class Run(Protocol):
    """What a Rollout and a Reference have in common."""

    @property
    def time(self) -> Vector: ...  # noqa: D102
    @property
    def qpos(self) -> Vector: ...  # noqa: D102
    @property
    def qvel(self) -> Vector: ...  # noqa: D102


@dataclass(frozen=True)
class Distance:
    """Sup norm over the run: positions [m, rad; quaternions as rotation vectors], velocities [m/s, rad/s]."""

    qpos: float
    qvel: float


def distance(scene: Scene, one: Run, other: Run) -> Distance:
    """The largest difference at any kept time; inf where one run ended earlier or is not finite.

    Raises ValueError where the runs are kept at different times.
    """
    if len(one.time) != len(other.time):
        return Distance(inf, inf)
    if np.any(np.abs(one.time - other.time) > TIME_SLACK_S):
        raise ValueError("the runs are kept at different times")
    turn = np.zeros(scene.model.nv)
    largest = 0.0
    for first, second in zip(one.qpos, other.qpos, strict=True):
        mujoco.mj_differentiatePos(scene.model, turn, 1.0, first, second)
        largest = max(largest, _sup(turn))
    return Distance(largest, _sup(one.qvel - other.qvel))


def _sup(values: Vector) -> float:
    """inf for NaN: a run that is not finite is infinitely far away."""
    largest = float(np.max(np.abs(values), initial=0.0))
    return largest if np.isfinite(largest) else inf


def errors(
    scene: Scene,
    reference: Run,
    timesteps_s: Sequence[float],
    *,
    integrator: int | None = None,
    stepper: Stepper | None = None,
) -> list[Distance]:
    """Distance to `reference` at its times, at each timestep [s], each of which must divide those times."""
    times = reference.time - scene.start.time_s
    runs = (
        simulate(scene, seconds=float(times[-1]), timestep_s=h, integrator=integrator, at_s=times, stepper=stepper)
        for h in timesteps_s
    )
    return [distance(scene, run, reference) for run in runs]


@dataclass(frozen=True)
class Order:
    """Slope of log error against log timestep, and its 95 % confidence interval."""

    order: float
    low: float
    high: float


def observed_order(timesteps_s: Sequence[float], error_values: Sequence[float]) -> Order:
    """Least squares through at least three points.

    Source: Student's t interval of a regression slope. Raises ValueError for fewer points, or errors that are zero
    or not finite.
    """
    h, e = np.asarray(timesteps_s, dtype=np.float64), np.asarray(error_values, dtype=np.float64)
    if len(h) < 3 or not np.all((e > 0) & np.isfinite(e)):
        raise ValueError("an order needs three or more positive, finite errors")
    (slope, _), covariance = np.polyfit(np.log(h), np.log(e), 1, cov=True)
    half = float(special.stdtrit(len(h) - 2, 0.975) * np.sqrt(covariance[0, 0]))
    return Order(float(slope), float(slope) - half, float(slope) + half)
