"""Finds a reference solution for a scene, and bounds its uncertainty by the distance between different methods.

Where no constraint acts, checked at every evaluation, DOP853 is of order 8. Where one does, two adaptive methods of low
order solve the same equations with errors controlled across impacts, and runs of RK4 and implicitfast at small
timesteps must come near them. Where the adaptive methods get stuck, the stepped runs are compared with each other.
"""

import os
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from math import inf, isfinite

import mujoco
import numpy as np
from numpy.typing import NDArray

from grader.numerics.accuracy.reference import Reference, find_obstacle, solve_adaptively, solve_dop853
from grader.numerics.integrators import EULER, IMPLICITFAST, RK4, Integrator
from grader.numerics.rollout import Rollout
from grader.numerics.scene import Vector
from grader.studies.advise.meter import Meter, Setting, extrapolate, interpolate

REFERENCE_SHARE = 0.1
"""The uncertainty of the reference, as a share of the tolerance, at which the search for a better one ends."""

ACCEPTED_SHARE = 0.4
"""The largest uncertainty with which a choice is made: every error has it added."""

REDUCTION = 2.0
"""The factor by which a halving may reduce the uncertainty; where even that would not do, halving ends early. Source:
methods of first order, as all are across contacts."""

REFERENCE_S = (0.0004, 0.0002, 0.0001, 0.00005, 0.000025, 0.0000125)
"""Timesteps [s] of the stepped runs: halved until two of them agree."""

CONFIRMING_S = REFERENCE_S[1:5]
"""The same where they confirm an adaptive reference."""

SHRINKS = 0.75
"""Factor a halving by which stepped runs must approach an adaptive reference to confirm it. Source: methods of first
order halve their distance; impacts at other phases of a step make it vary."""

RTOLS = (1e-7, 1e-9, 1e-11, 1e-13)
"""Tolerances of DOP853: tightened until two of them agree, from the first within RTOLS_SHARE of the tolerance on."""

RTOLS_SHARE = 1e-3

UNTIL_MIN_S = 0.1
"""Shortest part of a run [s] for which a choice is made where the whole cannot be told."""

RTOL_MAX, RTOL_SHARES, RTOL_MIN = 1e-5, (1e-2, 1e-3), 1e-10
"""Tolerances of the adaptive methods: these shares of the tolerance of the question, between these bounds. The second
is for where the first leaves more uncertainty than a choice may have."""

RTOL_GAIN = 0.01
"""Factor by which the second tolerance may shrink the distance between two adaptive methods: tenfold by the tolerance,
and as much again where a sooner impact no longer sends them apart."""

LONGER = 2.0
"""How many times longer than stepped runs two adaptive methods must agree for smaller timesteps to confirm them."""

PAIR_S_MAX = 4.0
"""Predicted CPU time [s] of a pair of stepped runs beyond which only three are made: large models take long."""

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
        self, meter: Meter, tolerance: float, methods: frozenset[Integrator], *, first: Sequence[Rollout], until: float,
        evaluation_s: float, progress: Say, pool: ThreadPoolExecutor,
    ) -> None:  # fmt: skip
        self.meter, self.tolerance, self.until = meter, tolerance, until
        self.fourth = RK4 if RK4 in methods else EULER
        self.evaluation_s, self.progress, self.pool = evaluation_s, progress, pool
        self.first = [run for run in first if run.diverged_at_step is None]
        self.pairs: dict[float, tuple[Rollout, Rollout]] = {}
        self.stuck_s: float | None = None

    def find(self, times_s: Vector) -> Solution:
        """Returns the reference that is certain for the longest time. Raises RuntimeError where there is none."""
        scene, adaptive = self.meter.scene, None
        if find_obstacle(scene, constraints=False) is None:
            try:
                if find_obstacle(scene) is None or any(run.unconstrained for run in self.first):
                    return self.solve_smooth(times_s)
            except Touched:
                pass
            self.progress("a constraint acts: the reference needs steps")
            adaptive = self.solve_across_constraints(times_s)
            if adaptive is not None and self.accepts(adaptive[1][-1]):
                confirmed = self.confirm(*adaptive, times_s)
                if self.accepts(confirmed.doubts[-1]):
                    return confirmed
        agreed = 0 if adaptive is None else self.count_accepted(adaptive[1])
        try:
            stepped = self.step_pairs(times_s, agreed)
        except OutOfTime:
            if adaptive is None:
                raise
            return self.confirm(*adaptive, times_s, spend=False)
        if adaptive is None:
            return stepped
        accepted = self.count_accepted(stepped.doubts)
        partly = self.confirm(*adaptive, times_s, spend=agreed > LONGER * accepted)
        return partly if self.count_accepted(partly.doubts) > accepted else stepped

    def accepts(self, doubt: float | Vector) -> NDArray[np.bool_]:
        """Whether a choice can be made with this uncertainty."""
        return np.asarray(np.asarray(doubt) <= ACCEPTED_SHARE * self.tolerance)

    def count_accepted(self, doubts: Vector) -> int:
        """Returns at how many times, from the first on, a choice can be made."""
        return int(np.sum(self.accepts(doubts)))

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

        has_solution = False
        for rtol in [rtol for rtol in RTOLS[:-2] if rtol <= RTOLS_SHARE * self.tolerance] + [*RTOLS[-2:]]:
            self.progress(f"the reference: DOP853 at a tolerance of {rtol:g}")
            try:
                yield solve_dop853(
                    self.meter.scene, times_s, rtol=rtol, atol=rtol / 100, forward=forward, constraints=False
                )
            except OutOfTime:
                if not has_solution:
                    raise
                return
            has_solution = True

    def solve_across_constraints(self, times_s: Vector) -> tuple[Reference, Vector] | None:
        """Returns a solution by RK45, up to where it got stuck, and its distance to RK23; None where one got stuck at
        once, or the budget is spent. Solves again at the second tolerance where that may tell for longer."""
        best: tuple[Reference, Vector] | None = None
        for share in RTOL_SHARES:
            rtol = float(np.clip(share * self.tolerance, RTOL_MIN, RTOL_MAX))
            self.progress(f"the reference: RK23 and RK45 at a tolerance of {rtol:g}, across constraints")
            low, high = solve_adaptively(self.meter.scene, times_s, "RK23", "RK45", rtol=rtol, until=self.until)
            apart, reached = self.meter.distances(low, high, times_s), len(high.time)
            if not reached:
                self.stuck_s = 0.0
                break
            if best is None or self.count_accepted(apart) >= self.count_accepted(best[1]):
                best = high, apart
            self.stuck_s = float(times_s[reached - 1]) if reached < len(times_s) else None
            hopeful = 2 * reached >= len(times_s) and self.accepts(apart[reached - 1] * RTOL_GAIN)
            if self.accepts(apart[-1]) or not hopeful:
                break
        return best

    def confirm(self, best: Reference, agree: Vector, times_s: Vector, *, spend: bool = True) -> Solution:
        """Returns the adaptive solution, uncertain by its distance to the other, `agree`, where stepped runs are near
        or come nearer with every halving, else by the distance to them too. The first runs come first, then ever
        smaller timesteps; without `spend` only those that were run before."""
        gap = np.minimum.reduce([self.meter.distances(run, best, times_s) for run in self.first], initial=inf)
        doubts = np.where(gap <= REFERENCE_SHARE * self.tolerance, agree, np.maximum(agree, gap))
        first: Vector | None = None
        for index, finest_s in enumerate(CONFIRMING_S):
            if np.array_equal(self.accepts(doubts), self.accepts(agree)):
                break
            agreed = times_s[: self.count_accepted(agree)]
            pair = self.run_pair(finest_s, agreed) if spend else self.pairs.get(finest_s)
            if pair is None:
                break
            gap = np.minimum(*(self.meter.distances(run, best, times_s) for run in pair))
            first = gap if first is None else first
            near = gap <= REFERENCE_SHARE * self.tolerance
            nearer = self.accepts(gap) & (gap <= SHRINKS**index * first) if index else near
            doubts = np.minimum(doubts, np.where(near | nearer, agree, np.maximum(agree, gap)))
        return Solution(best, "RK45 across constraints", np.maximum.accumulate(doubts))

    def run_pair(self, finest_s: float, times_s: Vector) -> tuple[Rollout, Rollout] | None:
        """Returns runs of a fourth-order and a first-order method of about the same cost, which are made once; None
        beyond the budget, and from the fourth pair on where that takes long.

        Euler takes the place of RK4 where that is refused or diverges.
        """
        if finest_s in self.pairs:
            return self.pairs[finest_s]
        fourth, low = self.fourth, IMPLICITFAST
        settings = ((fourth, RK4_RATIO * finest_s if fourth is RK4 else finest_s), (low, finest_s))
        cost_s = sum(self.predict_cost(setting, times_s[-1]) for setting in settings)
        if time.monotonic() + cost_s / min(CORES, 2) > self.until or (cost_s > PAIR_S_MAX and len(self.pairs) > 2):
            return None
        self.progress(f"the reference: {fourth.name} and {low.name} at {1e6 * finest_s:g} us")
        high, first_order = self.pool.map(self.meter.reference_run, settings, [times_s] * 2)
        if high.diverged_at_step is not None and fourth is RK4:  # too stiff for an explicit method
            self.fourth = EULER
            high = self.meter.reference_run((EULER, finest_s), times_s)
        self.pairs[finest_s] = high, first_order
        return high, first_order

    def step_pairs(self, times_s: Vector, least: int) -> Solution:
        """Returns a run of RK4 at ever smaller timesteps, beside one of a first-order method at half of each.

        Ends where the uncertainty is small enough, where no further halving can make it so, or before the budget does.
        The runs end where the halvings that are left can no longer make it so, but for the `least` first times.
        """
        best: Rollout | None = None
        doubts, hopeful = np.full(len(times_s), inf), len(times_s)
        before: tuple[Rollout, Rollout] | None = None
        for finest_s in REFERENCE_S:
            pair = self.run_pair(finest_s, times_s[:hopeful])
            if pair is None:
                break
            if before is not None and before[0].integrator != pair[0].integrator:
                before = None
            now = doubts
            if before is not None:
                now = np.append(self.compare_pairs(times_s[:hopeful], before, pair), doubts[hopeful:])
                now = np.maximum.accumulate(now)
            better = now[hopeful - 1] < doubts[hopeful - 1]
            if best is None or better or self.count_accepted(now) > self.count_accepted(doubts):
                doubts, best = now, pair[0]
            if doubts[-1] <= REFERENCE_SHARE * self.tolerance or self.is_hopeless(now, times_s, finest_s):
                break
            before = pair
            hopeful = min(hopeful, max(least, self.count_hopeful(now, times_s, finest_s)))
        if best is None or before is None:
            raise OutOfTime("the budget is too small for a reference solution")
        return Solution(best, f"{self.fourth.name} in small steps", doubts)

    def explain(self, solution: Solution, times_s: Vector) -> str:
        """Returns why this reference is too uncertain for the whole run."""
        doubt, reasons = solution.doubts[-1], list[str]()
        if isfinite(doubt):
            reasons.append(f"the reference itself is uncertain by {doubt:.2g}, too much for {self.tolerance:g}")
        ended = [run for pair in list(self.pairs.values())[-1:] for run in pair if run.diverged_at_step is not None]
        if ended:
            latest = max(ended, key=lambda run: run.steps * run.timestep_s)
            name = latest.warning.name if latest.warning is not None else "time ran backwards"
            reasons.append(
                f"the motion ends with {name} after {latest.steps * latest.timestep_s:.3g} s even at "
                f"{1e6 * latest.timestep_s:.3g} us"
            )
        if self.stuck_s is not None:
            where = f"from {self.stuck_s:.2g} s on" if self.stuck_s else "from the start"
            reasons.append(f"adaptive methods get stuck {where}, as where contacts stick and slip")
        part = float(times_s[self.accepts(solution.doubts)].max(initial=0.0))
        if part < UNTIL_MIN_S:
            reasons.append(
                f"it is certain enough up to {part:.2g} s only, too short a time to choose for"
                if part
                else "it is not certain enough at any time"
            )
        return "; ".join(reasons)

    def predict_cost(self, setting: Setting, seconds: float) -> float:
        """Returns the expected time [s] of a run on one core."""
        return self.evaluation_s * setting[0].evaluations * seconds / setting[1]

    def count_hopeful(self, doubts: Vector, times_s: Vector, finest_s: float) -> int:
        """Returns up to which time, as a count, halvings may reduce the uncertainty enough: those that are left and one
        more, as it falls faster at first, and never less than UNTIL_MIN_S."""
        left = sum(h < finest_s for h in REFERENCE_S)
        least = doubts / REDUCTION ** (left + 1)
        lost = np.isfinite(doubts) & ~self.accepts(least) & (times_s > UNTIL_MIN_S)
        return int(np.argmax(lost)) if lost.any() else len(times_s)

    def is_hopeless(self, doubts: Vector, times_s: Vector, finest_s: float) -> bool:
        """Whether the halvings that are left cannot reduce the uncertainty enough, judged from the fourth pair on, and
        from the second where that can tell for a part of the run."""
        left = sum(h < finest_s for h in REFERENCE_S)
        least = doubts[-1] / REDUCTION**left
        part = times_s[self.accepts(doubts)].max(initial=0.0) >= UNTIL_MIN_S
        judged = part or finest_s < REFERENCE_S[2]
        return bool(judged and isfinite(doubts[-1]) and least > ACCEPTED_SHARE * self.tolerance)

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
