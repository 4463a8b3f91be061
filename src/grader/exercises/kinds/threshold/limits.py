"""Finds the limits that a right bracket holds, for the verdict's expected values and for the chance of luck."""

from collections.abc import Callable
from functools import lru_cache
from math import inf

from grader.exercises.kinds.threshold.judging.judge import SLACK, grows, has_limit
from grader.exercises.kinds.threshold.parameters import Cell, ThresholdParameters
from grader.numerics.scene import Scene
from grader.numerics.stability.bisection import find_threshold
from grader.numerics.stability.equilibrium import find_equilibrium
from grader.numerics.stability.horizon import warns_within

RELATIVE_WIDTH = 0.001
"""The precision of the limits from which the chance of luck is estimated."""

SHOWN_WIDTH_S = 1e-6
"""The precision of the expected limits in a finding."""


def describe_expected(parameters: ThresholdParameters, cell: Cell) -> str:
    """Returns the span of right readings in words: from the linear stability limit to the limit within the horizon."""
    span = find_span(cell.scene, cell.integrator.code, parameters.search_s, parameters.horizon_s)
    if span is None:
        return "None"
    within = f"{1000 * span[1]:.2f} ms (within {parameters.horizon_s:g} s)"
    return f"a limit from {1000 * span[0]:.2f} ms (linear stability) to {within}"


@lru_cache(maxsize=64)
def find_span(scene: Scene, code: int, search_s: tuple[float, float], horizon_s: float) -> tuple[float, float] | None:
    """Returns the linear limit and the limit within the horizon [s]; None if the longest timestep raises no warning."""
    low, high = search_s
    bracket = find_threshold(
        scene, low_s=low, high_s=high, horizon_s=horizon_s, integrator=code, width_s=SHOWN_WIDTH_S, scan_step_s=high
    ).bracket_s
    if bracket is None:
        return None
    stable, growing = low, bracket[1]
    while growing - stable > SHOWN_WIDTH_S:
        middle = (stable + growing) / 2
        stable, growing = (stable, middle) if grows(find_equilibrium(scene), code, middle) else (middle, growing)
    return growing, bracket[1]


def find_accepted_ends(parameters: ThresholdParameters, cell: Cell) -> tuple[float, float]:
    """Returns between which values [s] the lower end of the widest bracket is accepted; (inf, inf) if None is right.
    The limit within the horizon is found to a thousandth, on its far side."""
    scene, code = cell.scene, cell.integrator.code
    low, high = parameters.search_s
    if not has_limit(scene, code, high, parameters.horizon_s):
        return inf, inf
    linear = bisect(lambda h: grows(cell.rest, code, h), low, high)
    if linear == high:
        linear = within = bisect(lambda h: warns_within(scene, h, parameters.horizon_s, integrator=code), low, high)
    else:
        within = bisect(
            lambda h: warns_within(scene, h, parameters.horizon_s, integrator=code), linear, min(1.1 * linear, high)
        )
    return linear * (1 - RELATIVE_WIDTH) / (1 + SLACK) - parameters.width_s, within / (1 - SLACK)


def bisect(unstable: Callable[[float], bool], low: float, high: float) -> float:
    """Returns the upper end of the bracket that bisection between `low` and `high` [s] ends with."""
    while high - low > RELATIVE_WIDTH * high:
        middle = (low + high) / 2
        low, high = (low, middle) if unstable(middle) else (middle, high)
    return high
