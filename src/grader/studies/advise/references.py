"""Finds a reference solution for a scene, and bounds its uncertainty by the distance between different methods.

Where no constraint acts, checked at every evaluation, DOP853 is of order 8. Where one does, two adaptive methods of low
order solve the same equations with errors controlled across impacts, and runs of RK4 and implicitfast at small
timesteps must come near them. Where the adaptive methods get stuck, the stepped runs are compared with each other.
"""

import os
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from math import inf, isfinite

import mujoco
import numpy as np
from numpy.typing import NDArray

from grader.numerics.accuracy.reference import Adaptive, Reference, find_obstacle, solve_adaptively, solve_dop853
from grader.numerics.integrators import EULER, IMPLICITFAST, RK4, Integrator
from grader.numerics.rollout import Rollout
from grader.numerics.scene import Scene, Vector
from grader.studies.advise.meter import Meter, Setting, extrapolate, interpolate

REFERENCE_SHARE = 0.1
"""The uncertainty of the reference, as a share of the tolerance, at which the search for a better one ends."""

ACCEPTED_SHARE = 0.4
"""The largest uncertainty with which a choice is made: every error has it added."""

REDUCTION = 2.5
"""The factor by which a halving may reduce the uncertainty; where even that would not do, halving ends early."""

REFERENCE_S = (0.0002, 0.0001, 0.00005, 0.000025, 0.0000125)
"""Timesteps [s] of the stepped runs: halved until two of them agree."""

CONFIRMING_S = REFERENCE_S[:4]
"""The same where they confirm an adaptive reference."""

SHRINKS = 0.75
"""Factor a halving by which stepped runs must approach an adaptive reference to confirm it. Source: methods of first
order halve their distance; impacts at other phases of a step make it vary."""

RTOLS = (1e-9, 1e-11, 1e-13)
"""Tolerances of DOP853: tightened until two of them agree."""

RTOL_MAX, RTOL_SHARE, RTOL_MIN = 1e-6, 1e-3, 1e-10
"""Tolerance of the adaptive methods: this share of the tolerance of the question, between these bounds."""

RK4_RATIO = 2
"""The timestep of RK4 relative to that of the method beside it: both then cost about the same."""

CORES = os.cpu_count() or 1
"""Runs at a time: mj_step releases Python's lock."""

Say = Callable[[str], object]


class OutOfTime(RuntimeError):
    """The budget is spent."""


class Touched(Exception):
    """A constraint acts, so that the equations are not smooth."""


@dataclass(frozen=True)
class Solution:
    """A reference, how it was made, and its uncertainty up to each of the times, (n,)."""

    states: Rollout | Reference
    method: str
    doubts: Vector


class References:
    """The search for a reference: within `until` of the monotonic clock, for errors of `tolerance`."""

    def __init__(
        self, meter: Meter, tolerance: float, methods: frozenset[Integrator], *, until: float, evaluation_s: float,
        progress: Say, pool: ThreadPoolExecutor,
    ) -> None:  # fmt: skip
        self.meter, self.tolerance, self.until = meter, tolerance, until
        self.fourth = RK4 if RK4 in methods else EULER
        self.evaluation_s, self.progress, self.pool = evaluation_s, progress, pool

    def find(self, times_s: Vector) -> Solution:
        """Returns the reference that is certain for the longest time. Raises RuntimeError where there is none."""
        scene, adaptive = self.meter.scene, None
        if find_obstacle(scene, constraints=False) is None:
            try:
                if find_obstacle(scene) is None or is_free(scene):
                    return self.solve_smooth(times_s)
            except Touched:
                self.progress("a constraint acts: the reference needs steps")
            adaptive = self.solve_across_constraints(times_s)
            if adaptive is not None and self.accepts(adaptive.doubts[-1]):
                return adaptive
        try:
            stepped = self.step_pairs(times_s)
        except OutOfTime:
            if adaptive is None:
                raise
            return adaptive
        if adaptive is None or np.sum(self.accepts(stepped.doubts)) >= np.sum(self.accepts(adaptive.doubts)):
            return stepped
        return adaptive

    def accepts(self, doubt: float | Vector) -> NDArray[np.bool_]:
        """Whether a choice can be made with this uncertainty."""
        return np.asarray(np.asarray(doubt) <= ACCEPTED_SHARE * self.tolerance)

    def solve_smooth(self, times_s: Vector) -> Solution:
        """Returns the first solution by DOP853 with which the one before agrees, or the last. Raises Touched."""
        best: Reference | None = None
        doubts = np.full(len(times_s), inf)
        for finer in self._solve_dop853(times_s):
            if best is not None:
                doubts = self.meter.distances(best, finer, times_s)
                if doubts[-1] <= REFERENCE_SHARE * self.tolerance:
                    return Solution(finer, "DOP853", doubts)
            best = finer
        assert best is not None
        return Solution(best, "DOP853", doubts)

    def _solve_dop853(self, times_s: Vector) -> Iterator[Reference]:
        """Solutions at ever tighter tolerances, as long as the budget lasts."""

        def forward(model: mujoco.MjModel, data: mujoco.MjData) -> None:
            if time.monotonic() > self.until:
                raise OutOfTime("the budget is too small for a reference solution")
            mujoco.mj_forward(model, data)
            if data.nefc:
                raise Touched

        found = False
        for rtol in RTOLS:
            self.progress(f"the reference: DOP853 at a tolerance of {rtol:g}")
            try:
                yield solve_dop853(self.meter.scene, times_s, rtol=rtol, forward=forward, constraints=False)
            except OutOfTime:
                if not found:
                    raise
                return
            found = True

    def solve_across_constraints(self, times_s: Vector) -> Solution | None:
        """Returns a solution by RK45, up to where it got stuck, held against RK23 and against stepped runs.

        Its uncertainty is its distance to RK23 where stepped runs are near and come nearer with every halving, else the
        distance to them too. None where it got stuck at once, or the budget is spent.
        """
        rtol = float(np.clip(RTOL_SHARE * self.tolerance, RTOL_MIN, RTOL_MAX))
        solutions = []
        methods: tuple[Adaptive, ...] = ("RK23", "RK45")
        for method in methods:
            self.progress(f"the reference: {method} at a tolerance of {rtol:g}, across constraints")
            solutions.append(solve_adaptively(self.meter.scene, times_s, method, rtol=rtol, until=self.until))
            if not len(solutions[-1].time):
                return None
        other, best = solutions
        agree = self.meter.distances(other, best, times_s)
        doubts = np.full(len(times_s), inf)
        first: Vector | None = None
        for index, finest_s in enumerate(CONFIRMING_S):
            pair = self.run_pair(finest_s, times_s)
            if pair is None:
                break
            gap = np.minimum(*(self.meter.distances(run, best, times_s) for run in pair))
            first = gap if first is None else first
            near = gap <= REFERENCE_SHARE * self.tolerance
            nearer = self.accepts(gap) & (gap <= SHRINKS**index * first) if index else near
            doubts = np.minimum(doubts, np.where(near | nearer, agree, np.maximum(agree, gap)))
            if np.array_equal(self.accepts(doubts), self.accepts(agree)):
                break
        return Solution(best, "RK45 across constraints", np.maximum.accumulate(doubts))

    def run_pair(self, finest_s: float, times_s: Vector) -> tuple[Rollout, Rollout] | None:
        """Returns runs of a fourth-order and a first-order method of about the same cost; None beyond the budget.

        Euler takes the place of RK4 where that is refused or diverges.
        """
        fourth, low = self.fourth, IMPLICITFAST
        settings = ((fourth, RK4_RATIO * finest_s if fourth is RK4 else finest_s), (low, finest_s))
        if time.monotonic() + sum(map(self.predict_cost, settings)) / min(CORES, 2) > self.until:
            return None
        self.progress(f"the reference: {fourth.name} and {low.name} at {1e6 * finest_s:g} us")
        high, first_order = self.pool.map(self.meter.reference_run, settings, [times_s] * 2)
        if high.diverged_at_step is not None and fourth is RK4:  # too stiff for an explicit method
            self.fourth = EULER
            high = self.meter.reference_run((EULER, finest_s), times_s)
        return high, first_order

    def step_pairs(self, times_s: Vector) -> Solution:
        """Returns a run of RK4 at ever smaller timesteps, beside one of a first-order method at half of each.

        Ends where the uncertainty is small enough, where no further halving can make it so, or before the budget does.
        """
        best: Rollout | None = None
        doubts = np.full(len(times_s), inf)
        before: tuple[Rollout, Rollout] | None = None
        for finest_s in REFERENCE_S:
            fourth, pair = self.fourth, self.run_pair(finest_s, times_s)
            if pair is None:
                break
            if self.fourth is not fourth:
                before = None
            now = doubts if before is None else self.compare_pairs(times_s, before, pair)
            if best is None or now[-1] < doubts[-1] or np.sum(self.accepts(now)) > np.sum(self.accepts(doubts)):
                doubts, best = now, pair[0]
            if doubts[-1] <= REFERENCE_SHARE * self.tolerance or self.is_hopeless(now[-1], finest_s):
                break
            before = pair
        if best is None or before is None:
            raise OutOfTime("the budget is too small for a reference solution")
        return Solution(best, f"{self.fourth.name} in small steps", doubts)

    def predict_cost(self, setting: Setting) -> float:
        """Returns the expected time [s] of a run on one core."""
        return self.evaluation_s * setting[0].evaluations * self.meter.seconds / setting[1]

    def is_hopeless(self, doubt: float, finest_s: float) -> bool:
        """Whether the halvings that are left cannot reduce the uncertainty enough, judged from the third pair on."""
        left = sum(h < finest_s for h in REFERENCE_S)
        least = doubt / REDUCTION**left
        return isfinite(doubt) and finest_s < REFERENCE_S[1] and least > ACCEPTED_SHARE * self.tolerance

    def compare_pairs(self, times_s: Vector, before: tuple[Rollout, Rollout], now: tuple[Rollout, Rollout]) -> Vector:
        """Returns, up to each time, the largest distance of the RK4 run to the one before, and to the method of first
        order or, where that is nearer, its extrapolation: errors of different methods do not cancel."""
        (high, low), (coarser, lower), scene = now, before, self.meter.scene
        itself = self.meter.distances(coarser, high, times_s)
        other = self.meter.distances(low, high, times_s)
        kept = times_s[: int(np.sum(np.isfinite(np.maximum(itself, other))))]
        if len(kept):
            times = kept + scene.start.time_s
            limit = extrapolate(scene, interpolate(scene, lower, times), interpolate(scene, low, times))
            other = np.minimum(other, self.meter.distances(limit, high, times_s))
        return np.asarray(np.maximum(itself, other))


def is_free(scene: Scene) -> bool:
    """Whether no constraint acts at the start."""
    with scene.borrow() as workspace:
        mujoco.mj_forward(workspace.model, workspace.data)
        return int(workspace.data.nefc) == 0
