"""Finds a threshold by bisection from a linear prediction, and stable windows above it on a grid."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import StrEnum
from itertools import pairwise
from math import ceil, isfinite, log
from sys import float_info

import mujoco
import numpy as np

from grader.numerics.scene import Scene, State, resolve_options
from grader.numerics.stability.equilibrium import find_equilibrium
from grader.numerics.stability.linear import compute_spectral_radius
from grader.numerics.stability.trials import Criterion, Stability, Trial, try_timestep

SCAN_POINTS = 24
"""Grid cells without `scan_step_s`: windows narrower than a 24th of the range may be missed."""

GUESS_ERROR = 5e-4
"""Relative error of the linear prediction. Source: it is 0.4e-3 below the limit of the lesson's servo within 3 s,
because gravity is weaker at large angles."""

TINY = float_info.min
"""Replaces a spectral radius of 0 in logarithms."""


class SearchResult(StrEnum):
    """The result of a search."""

    BRACKET = "a stable timestep with an unstable one above it"
    ALL_STABLE = "stable over the whole range"
    NONE_STABLE = "unstable from the lower end on"
    UNDECIDED = "undecided"


@dataclass(frozen=True)
class Window:
    """A range of stable timesteps above the threshold: the first and the last found stable [s]."""

    low_s: float
    high_s: float


@dataclass(frozen=True)
class Threshold:
    """The lowest stable/unstable bracket found, with the conditions under which it holds. `low` is stable and `high`
    unstable, both simulated; both are None unless `result` is BRACKET. `reason` explains `result` in words. `windows`
    narrower than `scan_step_s` may be missed. `simulations` is the number of runs."""

    low: Trial | None
    high: Trial | None
    windows: tuple[Window, ...]
    result: SearchResult
    reason: str
    horizon_s: float
    criterion: Criterion
    start: State
    integrator: int
    scan_step_s: float
    simulations: int

    @property
    def bracket_s(self) -> tuple[float, float] | None:
        """(stable, unstable) [s], or None."""
        return (self.low.timestep_s, self.high.timestep_s) if self.low and self.high else None


@dataclass
class _Search:
    """Simulates each timestep at most once and keeps its trial."""

    scene: Scene
    horizon_s: float
    integrator: int
    criterion: Criterion
    trials: dict[float, Trial] = field(default_factory=dict)

    def stability(self, timestep_s: float) -> Stability:
        if timestep_s not in self.trials:
            self.trials[timestep_s] = try_timestep(
                self.scene, timestep_s, self.horizon_s, integrator=self.integrator, criterion=self.criterion
            )
        return self.trials[timestep_s].stability

    def narrow(self, low_s: float, high_s: float, width_s: float, guess_s: float | None) -> tuple[float, float]:
        """Narrow a bracket, whose ends differ in stability, to `width_s`; both ends remain simulated. Timesteps near a
        guess are tried first, at growing distance, so that a good guess costs two runs."""
        lowest = self.stability(low_s)
        for probe in _guess_outwards(guess_s, width_s, low_s, high_s) if guess_s is not None else ():
            if low_s < probe < high_s:
                low_s, high_s = (probe, high_s) if self.stability(probe) is lowest else (low_s, probe)
        while high_s - low_s > width_s:
            middle = 0.5 * (low_s + high_s)
            if not low_s < middle < high_s:
                break
            low_s, high_s = (middle, high_s) if self.stability(middle) is lowest else (low_s, middle)
        return low_s, high_s


def find_threshold(
    scene: Scene, *, low_s: float, high_s: float, horizon_s: float = 3.0, integrator: int | None = None,
    width_s: float = 1e-6, criterion: Criterion = Criterion.ANY_WARNING, scan_step_s: float | None = None,
) -> Threshold:  # fmt: skip
    """Find the lowest timestep between `low_s` and `high_s` at which stability ends, to within `width_s`. Scans the
    range in steps of `scan_step_s` (default: SCAN_POINTS cells), which also finds stable windows above the limit.
    Raises ValueError for an empty range, and for a width or step that is not positive and finite."""
    if not (isfinite(high_s) and 0 < low_s < high_s and width_s > 0):
        raise ValueError(f"cannot search between {low_s} and {high_s} s to {width_s} s")
    if scan_step_s is not None and not scan_step_s > 0:
        raise ValueError(f"cannot scan in steps of {scan_step_s} s")
    integrator = resolve_options(scene.options, low_s, integrator)[1]
    search = _Search(scene, horizon_s, integrator, criterion)
    points = SCAN_POINTS if scan_step_s is None else max(1, ceil((high_s - low_s) / scan_step_s))
    grid = [float(h) for h in np.linspace(low_s, high_s, points + 1)]
    bracket, result, reason = _find_lowest_edge(search, grid, width_s)
    low, high = (search.trials[h] for h in bracket) if bracket else (None, None)
    windows = _find_windows(search, grid, bracket[1], width_s) if bracket else ()
    return Threshold(
        low, high, windows, result, reason, horizon_s, criterion, scene.start, integrator,
        scan_step_s=(high_s - low_s) / points, simulations=len(search.trials),
    )  # fmt: skip


def _predict_limit(search: _Search, low_s: float, high_s: float) -> float | None:
    """The timestep [s] at which linear growth of the start's acceleration reaches mjMAXVAL at the end of the horizon.
    None if there is no equilibrium, or no such timestep in the range."""
    from scipy import optimize  # SciPy takes half of the time that the grader takes to start

    resting = find_equilibrium(search.scene)
    if resting is None:
        return None
    with search.scene.borrow() as workspace:
        mujoco.mj_forward(workspace.model, workspace.data)
        acceleration = float(np.max(np.abs(workspace.data.qacc), initial=0.0))
    if not 0 < acceleration < mujoco.mjMAXVAL:
        return None
    needed = log(mujoco.mjMAXVAL / acceleration) / search.horizon_s

    def compute_excess(timestep_s: float) -> float:
        radius = compute_spectral_radius(resting, timestep_s=timestep_s, integrator=search.integrator)
        return log(max(radius, TINY)) / timestep_s - needed

    if not (compute_excess(low_s) < 0 < compute_excess(high_s) < mujoco.mjMAXVAL):
        return None
    return float(optimize.brentq(compute_excess, low_s, high_s, xtol=1e-7))


def _find_lowest_edge(
    search: _Search, grid: list[float], width_s: float
) -> tuple[tuple[float, float] | None, SearchResult, str]:
    """Returns the narrowed bracket below the first grid point that is not stable, or None; the result and a reason."""
    first = next((i for i, h in enumerate(grid) if search.stability(h) is not Stability.STABLE), None)
    if first is None:
        return None, SearchResult.ALL_STABLE, f"stable at all {len(grid)} timesteps tried up to {grid[-1]} s"
    trial = search.trials[grid[first]]
    if trial.stability is Stability.UNDECIDED:
        return None, SearchResult.UNDECIDED, f"at {trial.timestep_s} s: {trial.reason}"
    if first == 0:
        return None, SearchResult.NONE_STABLE, f"unstable already at {grid[0]} s: {trial.reason}"
    cell = grid[first - 1], grid[first]
    low, high = search.narrow(*cell, width_s, _predict_limit(search, *cell))
    if search.stability(high) is not Stability.UNSTABLE:
        return None, SearchResult.UNDECIDED, f"at {high} s: {search.trials[high].reason}"
    return (low, high), SearchResult.BRACKET, f"stable at {low} s, unstable at {high} s"


def _find_windows(search: _Search, grid: list[float], above_s: float, width_s: float) -> tuple[Window, ...]:
    """Ranges of stable grid points above the threshold, with narrowed ends."""
    above = [above_s, *(h for h in grid if h > above_s)]
    windows: list[Window] = []
    opened: float | None = None
    for low, high in pairwise(above):
        stable_low, stable_high = (search.stability(h) is Stability.STABLE for h in (low, high))
        if not stable_low and stable_high:
            opened = search.narrow(low, high, width_s, None)[1]
        elif stable_low and not stable_high and opened is not None:
            windows.append(Window(opened, search.narrow(low, high, width_s, None)[0]))
            opened = None
    if opened is not None:
        windows.append(Window(opened, above[-1]))
    return tuple(windows)


def _guess_outwards(guess_s: float, width_s: float, low_s: float, high_s: float) -> Iterator[float]:
    """Yield pairs of timesteps around a guess, each pair four times farther away, up to the width of the bracket."""
    reach = max(0.49 * width_s, GUESS_ERROR * guess_s)
    while reach < high_s - low_s:
        yield guess_s - reach
        yield guess_s + reach
        reach *= 4
