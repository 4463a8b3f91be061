"""The cheapest integrator and timestep that meet a tolerance on a scene, by measured error.

The lesson's procedure with a reference in place of a guess: refine until a quantity no longer changes by more than
the tolerance, and take the largest timestep below that point. Cost is counted in evaluations of the forward dynamics
per simulated second, so that the choice does not depend on the load of the machine.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import inf, isclose, isfinite

import mujoco
import numpy as np
from mujoco import mjtIntegrator

from grader.numerics.convergence import distance
from grader.numerics.measures import measure
from grader.numerics.reference import Reference, dop853, sample_times, unreferenced
from grader.numerics.rollout import Rollout, simulate
from grader.numerics.scene import Scene, Vector
from grader.numerics.stepping import STEPS_MAX

SAMPLE_S = 0.02
"""Errors are taken at multiples of this; every timestep below divides it."""

TIMESTEPS_S = (0.0001, 0.0002, 0.00025, 0.0005, 0.001, 0.002, 0.0025, 0.004, 0.005, 0.01, 0.02)

PREFERENCE = tuple(int(getattr(mjtIntegrator, f"mjINT_{name}")) for name in (
    "IMPLICITFAST", "EULER", "DISCRETE", "IMPLICIT", "RK4",
))  # fmt: skip
"""Who wins at equal cost: first the one that the lesson recommends to start from."""

EVALUATIONS = {int(mjtIntegrator.mjINT_RK4): 4}
"""Forward dynamics per step; 1 for the single-step methods."""

REFERENCE_SHARE = 0.1
"""The reference must be this much better than the tolerance, else nothing can be told."""

FINEST = 4
"""Where DOP853 cannot be used, the reference takes steps that are so many times shorter than the finest candidate."""

Quantity = Callable[[mujoco.MjModel, mujoco.MjData], float]


@dataclass(frozen=True)
class Candidate:
    """One integrator and timestep [s]: its error (inf where it diverged), and its cost [evaluations / s]."""

    integrator: int
    timestep_s: float
    error: float
    cost: float


@dataclass(frozen=True)
class Selection:
    """The choice, or None with the reason; `margin` is tolerance / error of the choice."""

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
    integrators: Sequence[int] = PREFERENCE,
    timesteps_s: Sequence[float] = TIMESTEPS_S,
) -> Selection:
    """Measure every candidate over `seconds` and choose; errors are sup norms of `quantity`, by default of qpos.

    A timestep counts only where all smaller ones tried also meet the tolerance: one that passes by accident does
    not. Raises ValueError for what `check_question` refuses, or timesteps that do not divide SAMPLE_S.
    """
    check_question(tolerance, seconds, timesteps_s)
    if any(not isclose(SAMPLE_S / h, round(SAMPLE_S / h)) for h in timesteps_s):
        raise ValueError(f"every timestep must divide {SAMPLE_S} s, at whose multiples errors are taken")
    times = sample_times(seconds, SAMPLE_S)
    meter = _Meter(scene, np.asarray(times), quantity)
    if scene.model.nhistory:
        return _cannot_tell("a delay is kept as a number of samples, so that no timestep is a measure of another")
    try:
        reference, doubt = _reference(meter, min(timesteps_s))
    except RuntimeError as error:
        return _cannot_tell(str(error))
    if not doubt <= REFERENCE_SHARE * tolerance:
        return _cannot_tell(
            f"the reference itself is uncertain by {doubt:.2g}, too much for a tolerance of {tolerance:g}", doubt
        )
    candidates = tuple(
        Candidate(int(i), h, meter.error(meter.run(int(i), h), reference), EVALUATIONS.get(int(i), 1) / h)
        for i in integrators
        for h in sorted(timesteps_s)
    )
    return _choose(candidates, tolerance, doubt)


def check_question(tolerance: float, seconds: float, timesteps_s: Sequence[float] = TIMESTEPS_S) -> None:
    """ValueError for a tolerance or a length [s] that is not positive and finite, or a length of too many steps."""
    if not (0 < tolerance < inf and SAMPLE_S <= seconds < inf):
        raise ValueError(f"tolerance must be positive and the run {SAMPLE_S} s or longer")
    longest = STEPS_MAX * min(timesteps_s) / FINEST
    if not seconds <= longest:
        raise ValueError(f"the run may last {longest:g} s at most, not {seconds:g} s")


def _cannot_tell(why: str, doubt: float = inf) -> Selection:
    return Selection(None, 0.0, f"cannot tell: {why}", doubt, ())


class _Meter:
    """Runs a scene and measures the difference of two runs, in positions or in a quantity."""

    def __init__(self, scene: Scene, times_s: Vector, quantity: Quantity | None) -> None:
        self.scene, self.times_s, self.quantity = scene, times_s, quantity

    def run(self, integrator: int, timestep_s: float) -> Rollout:
        return simulate(
            self.scene,
            seconds=float(self.times_s[-1]),
            timestep_s=timestep_s,
            integrator=integrator,
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
    """The best solution at hand, and how far it is from the second best.

    Smooth scenes: DOP853 at two tolerances. Others: the recommended integrator at a quarter and half of the finest
    timestep; what a method of first order changes there is about the error that is left.
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
        reason = f"none of the candidates meets {tolerance:g}; the best, {named(least)}, is off by {least.error:.2g}"
        return Selection(None, 0.0, reason, doubt, candidates)
    best = min(passing, key=lambda c: (c.cost, PREFERENCE.index(c.integrator)))
    margin = tolerance / best.error if best.error else inf
    reason = (
        f"{named(best)} meets {tolerance:g} with an error of {best.error:.2g} at {best.cost:g} evaluations a second"
    )
    return Selection(best, margin, reason, doubt, candidates)


def named(candidate: Candidate) -> str:
    """As people say it: implicitfast at 2 ms."""
    name = mjtIntegrator(candidate.integrator).name[6:]
    spelt = {"EULER": "Euler", "RK4": "RK4"}.get(name, name.lower())
    return f"{spelt} at {1000 * candidate.timestep_s:g} ms"
