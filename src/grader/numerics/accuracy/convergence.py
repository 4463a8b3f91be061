"""Distance between two runs, and the observed order of convergence."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from typing import Protocol

import mujoco
import numpy as np

from grader.numerics.scene import Scene, Vector

TIME_SLACK_S = 1e-9
"""Rounding of sums of timesteps; times that differ by more are different times."""


class TimeSeries(Protocol):
    """The fields that a Rollout and a Reference share."""

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


def measure_distance(scene: Scene, one: TimeSeries, other: TimeSeries) -> Distance:
    """Return the largest difference at any kept time; inf if one run ended earlier or is not finite. Raises ValueError
    if the runs are kept at different times."""
    if len(one.time) != len(other.time):
        return Distance(inf, inf)
    if np.any(np.abs(one.time - other.time) > TIME_SLACK_S):
        raise ValueError("the runs are kept at different times")
    return Distance(measure_position_distance(scene, one.qpos, other.qpos), _compute_sup(one.qvel - other.qvel))


def measure_position_distance(scene: Scene, one: Vector, other: Vector) -> float:
    """Sup norm over the rows of two (n, nq) [m, rad; quaternions as rotation vectors]; inf if not finite."""
    difference = np.zeros(scene.model.nv)
    largest = 0.0
    for first, second in zip(one, other, strict=True):
        mujoco.mj_differentiatePos(scene.model, difference, 1.0, first, second)
        largest = max(largest, _compute_sup(difference))
    return largest


def _compute_sup(values: Vector) -> float:
    """Returns the largest magnitude; inf if any value is not finite."""
    largest = float(np.max(np.abs(values), initial=0.0))
    return largest if np.isfinite(largest) else inf


@dataclass(frozen=True)
class OrderFit:
    """Slope of log error against log timestep, and its 95 % confidence interval."""

    order: float
    low: float
    high: float


def fit_order(timesteps_s: Sequence[float], error_values: Sequence[float]) -> OrderFit:
    """Fit the order by least squares through three or more points. Source: Student's t interval of a regression slope.
    Raises ValueError for fewer points, for errors or timesteps that are not positive and finite, and for one timestep
    alone."""
    from scipy import special  # SciPy takes half of the time that the grader takes to start

    h, e = np.asarray(timesteps_s, dtype=np.float64), np.asarray(error_values, dtype=np.float64)
    if len(h) < 3 or not np.all((e > 0) & np.isfinite(e)):
        raise ValueError("an order needs three or more positive, finite errors")
    if not np.all((h > 0) & np.isfinite(h)) or h.min() == h.max():
        raise ValueError("an order needs positive, finite timesteps that differ")
    (slope, _), covariance = np.polyfit(np.log(h), np.log(e), 1, cov=True)
    half = float(special.stdtrit(len(h) - 2, 0.975) * np.sqrt(covariance[0, 0]))
    return OrderFit(float(slope), float(slope) - half, float(slope) + half)
