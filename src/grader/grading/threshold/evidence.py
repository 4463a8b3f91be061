"""Pictures of a judged threshold, visible cases only: the angle at both ends of the claim, and the stability line."""

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from grader.grading.threshold.claims import Bracket
from grader.grading.threshold.parameters import Cell, Problem
from grader.grading.threshold.truth import Judged, at_rest, grows
from grader.numerics.linear import spectral_radius
from grader.numerics.rollout import simulate
from grader.numerics.scene import Scene
from grader.numerics.search import find_threshold

POINTS_MAX = 300
LINE_POINTS = 25
SHOWN_WIDTH_S = 1e-6


def evidence_of(problem: Problem, judged: Sequence[Judged]) -> dict[str, Any]:
    """`angles`: time [s] and the first coordinate at both ends; `stability`: timestep [ms] and spectral radius."""
    visible = [one for one in judged if not one.cell.hidden]
    return {
        "angles": [picture for one in visible for picture in angles(problem, one)],
        "stability": [stability(problem, one.cell) for one in visible],
    }


def expected_of(problem: Problem, cell: Cell) -> str:
    """The span of right readings in words: from the limit for ever to the limit within the horizon."""
    horizon_s = problem.parameters.horizon_s
    span = span_of(cell.scene, cell.code, problem.parameters.search_s, horizon_s)
    if span is None:
        return "None"
    return f"a limit from {1000 * span[0]:.2f} ms (for ever) to {1000 * span[1]:.2f} ms (within {horizon_s:g} s)"


@lru_cache(maxsize=64)
def span_of(scene: Scene, code: int, search_s: tuple[float, float], horizon_s: float) -> tuple[float, float] | None:
    """The limit for ever and the limit within the horizon [s]; None where the longest timestep raises no warning."""
    low, high = search_s
    found = find_threshold(
        scene, low_s=low, high_s=high, horizon_s=horizon_s, integrator=code, width_s=SHOWN_WIDTH_S, scan_step_s=high
    ).bracket_s
    if found is None:
        return None
    stable, growing = low, found[1]
    while growing - stable > SHOWN_WIDTH_S:
        middle = (stable + growing) / 2
        stable, growing = (stable, middle) if grows(scene, code, middle) else (middle, growing)
    return growing, found[1]


def angles(problem: Problem, judged: Judged) -> list[dict[str, Any]]:
    """The run at the lower and at the upper end of a bracket that can be simulated."""
    claim, (shortest, longest) = judged.claim, problem.parameters.search_s
    if not isinstance(claim, Bracket):
        return []
    ends = zip(("lower end", "upper end"), (claim.low, claim.high), strict=True)
    return [angle(problem, judged.cell, end, h) for end, h in ends if shortest <= h <= 2 * longest]


def angle(problem: Problem, cell: Cell, end: str, timestep_s: float) -> dict[str, Any]:
    """One run, thinned out."""
    steps = round(problem.parameters.horizon_s / timestep_s)
    rollout = simulate(cell.scene, steps=steps, timestep_s=timestep_s, integrator=cell.code)
    return {
        "case": cell.id,
        "end": end,
        "timestep_ms": 1000 * timestep_s,
        "diverged": rollout.diverged_at_step is not None,
        "time_s": thinned(rollout.time),
        "angle": thinned(rollout.qpos[:, 0]),
    }


def thinned(values: NDArray[np.float64]) -> list[float]:
    """At most POINTS_MAX of them, in order, first and last among them, to seven figures."""
    chosen = np.unique(np.linspace(0, len(values) - 1, min(len(values), POINTS_MAX)).round().astype(int))
    return [float(f"{value:.7g}") for value in values[chosen]]


def stability(problem: Problem, cell: Cell) -> dict[str, Any]:
    """Spectral radius of one step at rest against the timestep; above 1 a small deviation grows for ever."""
    line = np.linspace(*problem.parameters.search_s, LINE_POINTS)
    return {
        "case": cell.id,
        "timestep_ms": [float(f"{1000 * h:.7g}") for h in line],
        "radius": list(radii(cell.scene, cell.code, tuple(line.tolist()))),
    }


@lru_cache(maxsize=64)
def radii(scene: Scene, code: int, timesteps_s: tuple[float, ...]) -> tuple[float, ...]:
    """The spectral radius at each timestep, to seven figures; none where the scene has no equilibrium."""
    rest = at_rest(scene)
    if rest is None:
        return ()
    return tuple(float(f"{spectral_radius(rest, timestep_s=h, integrator=code):.7g}") for h in timesteps_s)
