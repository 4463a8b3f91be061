"""Select the cheapest integrator and timestep that meet a tolerance on a scene, by measured error.

This is the lesson's procedure with a reference solution: refine until a quantity no longer changes by more than the
tolerance, and take the largest timestep below that point. Cost is counted in evaluations of the forward dynamics per
simulated second, so that the choice does not depend on the load of the machine.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import inf, isclose, isfinite

import mujoco
import numpy as np

from grader.numerics.convergence import distance
from grader.numerics.integrators import DISCRETE, EULER, IMPLICIT, IMPLICITFAST, RK4, Integrator
from grader.numerics.measures import measure
from grader.numerics.reference import Reference, dop853, sample_times, unreferenced
from grader.numerics.rollout import Rollout, simulate
from grader.numerics.scene import Scene, Vector
from grader.numerics.stepping import STEPS_MAX

SAMPLE_S = 0.02
"""Errors are evaluated at multiples of this; every timestep in TIMESTEPS_S divides it."""

TIMESTEPS_S = (0.0001, 0.0002, 0.00025, 0.0005, 0.001, 0.002, 0.0025, 0.004, 0.005, 0.01, 0.02)

PREFERENCE = (IMPLICITFAST, EULER, DISCRETE, IMPLICIT, RK4)
"""Preferred order at equal cost; the first is the one from which the lesson starts."""

REFERENCE_SHARE = 0.1
"""The largest uncertainty of the reference, as a share of the tolerance, at which a choice is made."""

FINEST = 4
"""Where DOP853 cannot be used: the finest candidate's timestep over that of the reference."""

Quantity = Callable[[mujoco.MjModel, mujoco.MjData], float]


@dataclass(frozen=True)
class Candidate:
    """An integrator and a timestep [s], with the error (inf for a run that diverged) and the cost [evaluations / s]."""

    integrator: Integrator
    timestep_s: float
    error: float
    cost: float


@dataclass(frozen=True)
class Selection:
    """The best candidate, or None, with the reason in words.

    `margin` is the tolerance over the error of the best; `reference_error` the uncertainty of the reference.
    """

    best: Candidate | None
    margin: float
    reason: str
    reference_error: float
    candidates: tuple[Candidate, ...]


def select(
    scene: Scene,
    *,
    tolerance: float,
    seconds: float,
    quantity: Quantity | None = None,
    integrators: Sequence[Integrator] = PREFERENCE,
    timesteps_s: Sequence[float] = TIMESTEPS_S,
) -> Selection:
    """Measure every candidate over `seconds` and choose the cheapest that meets `tolerance`.

    Errors are sup norms of `quantity`, by default of qpos. A timestep passes only if all smaller ones of the same
    integrator pass too, so that one which meets the tolerance by accident is not chosen. Raises ValueError as
    `check_question` does, and for timesteps that do not divide SAMPLE_S.
    """
    check_question(tolerance, seconds, timesteps_s)
    if any(not isclose(SAMPLE_S / h, round(SAMPLE_S / h)) for h in timesteps_s):
        raise ValueError(f"every timestep must divide {SAMPLE_S} s, at whose multiples errors are evaluated")
    times = sample_times(seconds, SAMPLE_S)
    meter = _Meter(scene, np.asarray(times), quantity)
    if scene.model.nhistory:
        return _cannot_tell("a delay counts samples, so that runs at two timesteps are not comparable")
    try:
        reference, doubt = _reference(meter, min(timesteps_s))
    except RuntimeError as error:
        return _cannot_tell(str(error))
    if not doubt <= REFERENCE_SHARE * tolerance:
        return _cannot_tell(
            f"the reference itself is uncertain by {doubt:.2g}, too much for a tolerance of {tolerance:g}", doubt
        )
    candidates = tuple(
        Candidate(integrator, h, meter.error(meter.run(integrator, h), reference), integrator.evaluations / h)
        for integrator in integrators
        for h in sorted(timesteps_s)
    )
    return _choose(candidates, tolerance, doubt)


def check_question(tolerance: float, seconds: float, timesteps_s: Sequence[float] = TIMESTEPS_S) -> None:
    """Raise ValueError for a tolerance or length [s] that is not positive and finite, or a length of too many steps."""
    if not (0 < tolerance < inf and SAMPLE_S <= seconds < inf):
        raise ValueError(f"tolerance must be positive and the run {SAMPLE_S} s or longer")
    longest = STEPS_MAX * min(timesteps_s) / FINEST
    if not seconds <= longest:
        raise ValueError(f"the run may last {longest:g} s at most, not {seconds:g} s")


def _cannot_tell(why: str, doubt: float = inf) -> Selection:
    return Selection(None, 0.0, f"cannot tell: {why}", doubt, ())


class _Meter:
    """Runs a scene and measures the distance between two runs, in positions or in a quantity."""

    def __init__(self, scene: Scene, times_s: Vector, quantity: Quantity | None) -> None:
        self.scene, self.times_s, self.quantity = scene, times_s, quantity

    def run(self, integrator: Integrator, timestep_s: float) -> Rollout:
        return simulate(
            self.scene,
            seconds=float(self.times_s[-1]),
            timestep_s=timestep_s,
            integrator=integrator.code,
            at_s=self.times_s,
        )

    def error(self, one: Rollout | Reference, other: Rollout | Reference) -> float:
        if len(one.time) != len(other.time):
            return inf
        if self.quantity is None:
            return distance(self.scene, one, other).qpos
        values = (measure(self.scene, run, self.quantity) for run in (one, other))
        largest = float(np.max(np.abs(np.subtract(*values)), initial=0.0))
        return largest if isfinite(largest) else inf


def _reference(meter: _Meter, finest_s: float) -> tuple[Rollout | Reference, float]:
    """The reference solution, and its uncertainty: the distance to the second-best solution.

    Smooth scenes use DOP853 at two tolerances; others the first of PREFERENCE at a quarter and half of the finest
    timestep, where the difference estimates the remaining error of a first-order method.
    """
    if unreferenced(meter.scene) is not None:
        half, quarter = (meter.run(PREFERENCE[0], finest_s / k) for k in (FINEST / 2, FINEST))
        return quarter, meter.error(half, quarter)
    best, second = (dop853(meter.scene, meter.times_s, rtol=rtol) for rtol in (1e-13, 1e-11))
    return best, meter.error(second, best)


def _choose(candidates: tuple[Candidate, ...], tolerance: float, doubt: float) -> Selection:
    passing: list[Candidate] = []
    for integrator in dict.fromkeys(c.integrator for c in candidates):
        for candidate in (c for c in candidates if c.integrator == integrator):
            if candidate.error + doubt > tolerance:
                break
            passing.append(candidate)
    if not passing:
        least = min(candidates, key=lambda c: c.error)
        reason = (
            f"none of the candidates meets {tolerance:g}; the best, {named(least)}, has an error of {least.error:.2g}"
        )
        return Selection(None, 0.0, reason, doubt, candidates)
    best = min(passing, key=lambda c: (c.cost, PREFERENCE.index(c.integrator)))
    margin = tolerance / best.error if best.error else inf
    reason = (
        f"{named(best)} meets {tolerance:g} with an error of {best.error:.2g} at {best.cost:g} evaluations a second"
    )
    return Selection(best, margin, reason, doubt, candidates)


def named(candidate: Candidate) -> str:
    """The setting in words, such as `implicitfast at 2 ms`."""
    return f"{candidate.integrator.name} at {1000 * candidate.timestep_s:g} ms"
