"""Finds a threshold by bisection, seeded by the linear prediction, and looks for windows on a grid."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from math import ceil, isfinite, log
from sys import float_info

import mujoco
import numpy as np
from scipy import optimize

from grader.numerics.linear import RADIUS_NOISE, equilibrium, spectral_radius
from grader.numerics.scene import Scene, checked_options
from grader.numerics.threshold import Criterion, Found, Outcome, Threshold, Trial, Window, try_timestep

SCAN_POINTS = 24
"""Grid points of a search that names no scan step: windows narrower than a 24th of the range may be missed."""

SPECTRAL_POINTS = 64
"""Grid of `spectral_limit`; within a cell the radius is taken to pass 1 once."""

GUESS_ERROR = 5e-4
"""Relative. Source: the prediction is 0.4e-3 below the lesson's servo at 3 s, for gravity fades at large angles."""

TINY = float_info.min


@dataclass
class _Search:
    """Every timestep is simulated once; what was simulated is remembered, in order of timestep."""

    scene: Scene
    horizon_s: float
    integrator: int
    criterion: Criterion
    trials: dict[float, Trial] = field(default_factory=dict)

    def outcome(self, timestep_s: float) -> Outcome:
        if timestep_s not in self.trials:
            self.trials[timestep_s] = try_timestep(
                self.scene, timestep_s, self.horizon_s, integrator=self.integrator, criterion=self.criterion
            )
        return self.trials[timestep_s].outcome

    def narrow(self, low_s: float, high_s: float, width_s: float, guess_s: float | None) -> tuple[float, float]:
        """Shrink a bracket whose ends differ in outcome to `width_s`, keeping both ends simulated.

        Around a guess it is first tried ever farther out, so that a good guess costs two runs.
        """
        lowest = self.outcome(low_s)
        for probe in _outwards(guess_s, width_s, low_s, high_s) if guess_s is not None else ():
            if low_s < probe < high_s:
                low_s, high_s = (probe, high_s) if self.outcome(probe) is lowest else (low_s, probe)
        while high_s - low_s > width_s:
            middle = 0.5 * (low_s + high_s)
            if not low_s < middle < high_s:
                break
            low_s, high_s = (middle, high_s) if self.outcome(middle) is lowest else (low_s, middle)
        return low_s, high_s


def find_threshold(
    scene: Scene,
    *,
    low_s: float,
    high_s: float,
    horizon_s: float = 3.0,
    integrator: int | None = None,
    width_s: float = 1e-6,
    criterion: Criterion = Criterion.ANY_WARNING,
    scan_step_s: float | None = None,
) -> Threshold:
    """The lowest timestep between `low_s` and `high_s` at which stability ends, to `width_s`.

    The range is scanned every `scan_step_s` (default: in SCAN_POINTS steps), so that stable windows above the limit
    are seen. Raises ValueError where the range is empty, or a length is not finite or not positive.
    """
    if not (isfinite(high_s) and 0 < low_s < high_s and width_s > 0):
        raise ValueError(f"cannot search between {low_s} and {high_s} s to {width_s} s")
    if scan_step_s is not None and not scan_step_s > 0:
        raise ValueError(f"cannot scan in steps of {scan_step_s} s")
    integrator = checked_options(scene.model, low_s, integrator)[1]
    search = _Search(scene, horizon_s, integrator, criterion)
    points = SCAN_POINTS if scan_step_s is None else max(1, ceil((high_s - low_s) / scan_step_s))
    grid = [float(h) for h in np.linspace(low_s, high_s, points + 1)]
    bracket, found, reason = _lowest_edge(search, grid, width_s)
    low, high = (search.trials[h] for h in bracket) if bracket else (None, None)
    return Threshold(
        low=low,
        high=high,
        windows=_windows(search, grid, bracket[1], width_s) if bracket else (),
        found=found,
        reason=reason,
        horizon_s=horizon_s,
        criterion=criterion,
        start=scene.start,
        integrator=integrator,
        scan_step_s=(high_s - low_s) / points,
        simulations=len(search.trials),
    )


def spectral_limit(
    scene: Scene, *, low_s: float, high_s: float, integrator: int | None = None, width_s: float = 1e-9
) -> float | None:
    """The lowest timestep [s] at which the spectral radius at the scene's equilibrium passes 1, None if there is none.

    Stability for ever, of small motions. Raises ValueError where no equilibrium is found or the range is empty.
    """
    if not (isfinite(high_s) and 0 < low_s < high_s and width_s > 0):
        raise ValueError(f"cannot search between {low_s} and {high_s} s to {width_s} s")
    resting = equilibrium(scene)
    if resting is None:
        raise ValueError("no equilibrium was found to linearise at")

    def grows(timestep_s: float) -> bool:
        return spectral_radius(resting, timestep_s=timestep_s, integrator=integrator) > 1 + RADIUS_NOISE

    grid = np.linspace(low_s, high_s, SPECTRAL_POINTS + 1).tolist()
    first = next((i for i, h in enumerate(grid) if grows(h)), None)
    if first is None:
        return None
    if first == 0:
        return low_s
    low_s, high_s = grid[first - 1], grid[first]
    while high_s - low_s > width_s:
        middle = 0.5 * (low_s + high_s)
        low_s, high_s = (low_s, middle) if grows(middle) else (middle, high_s)
    return 0.5 * (low_s + high_s)


def predict(search: _Search, low_s: float, high_s: float) -> float | None:
    """Where linear growth from the start's acceleration just reaches MuJoCo's limit at the horizon's end."""
    resting = equilibrium(search.scene)
    if resting is None:
        return None
    with search.scene.borrow() as workspace:
        mujoco.mj_forward(workspace.model, workspace.data)
        acceleration = float(np.max(np.abs(workspace.data.qacc), initial=0.0))
    if not 0 < acceleration < mujoco.mjMAXVAL:
        return None
    needed = log(mujoco.mjMAXVAL / acceleration) / search.horizon_s

    def excess(timestep_s: float) -> float:
        radius = spectral_radius(resting, timestep_s=timestep_s, integrator=search.integrator)
        return log(max(radius, TINY)) / timestep_s - needed

    if not (excess(low_s) < 0 < excess(high_s) < mujoco.mjMAXVAL):
        return None
    return float(optimize.brentq(excess, low_s, high_s, xtol=1e-7))


def _lowest_edge(search: _Search, grid: list[float], width_s: float) -> tuple[tuple[float, float] | None, Found, str]:
    """The first grid point that is not stable, and the bracket before it, narrowed."""
    first = next((i for i, h in enumerate(grid) if search.outcome(h) is not Outcome.STABLE), None)
    if first is None:
        return None, Found.ALL_STABLE, f"stable at all {len(grid)} timesteps tried up to {grid[-1]} s"
    trial = search.trials[grid[first]]
    if trial.outcome is Outcome.UNDECIDED:
        return None, Found.UNDECIDED, f"at {trial.timestep_s} s: {trial.reason}"
    if first == 0:
        return None, Found.NONE_STABLE, f"unstable already at {grid[0]} s: {trial.reason}"
    cell = grid[first - 1], grid[first]
    low, high = search.narrow(*cell, width_s, predict(search, *cell))
    if search.outcome(high) is not Outcome.UNSTABLE:
        return None, Found.UNDECIDED, f"at {high} s: {search.trials[high].reason}"
    return (low, high), Found.BRACKET, f"stable at {low} s, unstable at {high} s"


def _windows(search: _Search, grid: list[float], above_s: float, width_s: float) -> tuple[Window, ...]:
    """Stretches of stable grid points above the threshold, their edges narrowed."""
    above = [above_s, *(h for h in grid if h > above_s)]
    found: list[Window] = []
    opened: float | None = None
    for low, high in pairwise(above):
        stable_low, stable_high = (search.outcome(h) is Outcome.STABLE for h in (low, high))
        if not stable_low and stable_high:
            opened = search.narrow(low, high, width_s, None)[1]
        elif stable_low and not stable_high and opened is not None:
            found.append(Window(opened, search.narrow(low, high, width_s, None)[0]))
            opened = None
    if opened is not None:
        found.append(Window(opened, above[-1]))
    return tuple(found)


def _outwards(guess_s: float, width_s: float, low_s: float, high_s: float) -> Iterator[float]:
    """Probes on either side of a guess, each pair four times farther out, until the bracket's ends."""
    reach = max(0.49 * width_s, GUESS_ERROR * guess_s)
    while reach < high_s - low_s:
        yield guess_s - reach
        yield guess_s + reach
        reach *= 4
