"""Pictures of judged claims: the angle at both ends of each claim, and the stability line."""

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from grader.exercises.kind import Judged, Trial
from grader.exercises.kinds.threshold.judge import Bracket, Claim, at_rest
from grader.exercises.kinds.threshold.parameters import Cell, ThresholdParameters
from grader.numerics.linear import spectral_radius
from grader.numerics.rollout import simulate
from grader.numerics.scene import Scene

POINTS_MAX = 300
LINE_POINTS = 25


def evidence_of(parameters: ThresholdParameters, visible: Sequence[Judged[Cell, Claim]]) -> dict[str, Any]:
    """Returns `angles`: time [s] and the first coordinate at both ends; `stability`: timestep [ms], spectral radius."""
    return {
        "angles": [picture for one in visible for picture in angles(parameters, one.trial, one.judgement.outcome)],
        "stability": [stability(parameters, one.trial) for one in visible],
    }


def angles(parameters: ThresholdParameters, trial: Trial[Cell], claim: Claim) -> list[dict[str, Any]]:
    """Returns the runs at both ends of a bracket, as far as they lie within the search."""
    shortest, longest = parameters.search_s
    if not isinstance(claim, Bracket):
        return []
    ends = zip(("lower end", "upper end"), (claim.low, claim.high), strict=True)
    return [angle(parameters, trial, end, h) for end, h in ends if shortest <= h <= 2 * longest]


def angle(parameters: ThresholdParameters, trial: Trial[Cell], end: str, timestep_s: float) -> dict[str, Any]:
    """Simulates at one end, and returns some points of the run."""
    scene, code = trial.problem.scene, trial.problem.integrator.code
    steps = round(parameters.horizon_s / timestep_s)
    rollout = simulate(scene, steps=steps, timestep_s=timestep_s, integrator=code)
    return {
        "case": trial.id,
        "end": end,
        "timestep_ms": 1000 * timestep_s,
        "diverged": rollout.diverged_at_step is not None,
        "time_s": thinned(rollout.time),
        "angle": thinned(rollout.qpos[:, 0]),
    }


def thinned(values: NDArray[np.float64]) -> list[float]:
    """Returns at most POINTS_MAX of the values to seven figures; the first and the last are kept."""
    chosen = np.unique(np.linspace(0, len(values) - 1, min(len(values), POINTS_MAX)).round().astype(int))
    return [float(f"{value:.7g}") for value in values[chosen]]


def stability(parameters: ThresholdParameters, trial: Trial[Cell]) -> dict[str, Any]:
    """Returns the spectral radius of one step at rest against the timestep; above 1 a small deviation grows."""
    line = np.linspace(*parameters.search_s, LINE_POINTS)
    return {
        "case": trial.id,
        "timestep_ms": [float(f"{1000 * h:.7g}") for h in line],
        "radius": list(radii(trial.problem.scene, trial.problem.integrator.code, tuple(line.tolist()))),
    }


@lru_cache(maxsize=64)
def radii(scene: Scene, code: int, timesteps_s: tuple[float, ...]) -> tuple[float, ...]:
    """Returns the spectral radius at each timestep, to seven figures; none if the scene has no equilibrium."""
    rest = at_rest(scene)
    if rest is None:
        return ()
    return tuple(float(f"{spectral_radius(rest, timestep_s=h, integrator=code):.7g}") for h in timesteps_s)
