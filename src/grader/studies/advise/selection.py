"""Select the cheapest integrator and timestep that meet a tolerance on a scene, by measured error.

This is the lesson's procedure with a reference solution: refine until a quantity no longer changes by more than the
tolerance, and take the largest timestep below that point. Every setting is measured once, the cheapest first, on all
cores. Cost is counted in evaluations of the forward dynamics per simulated second, so that the choice does not depend
on the load of the machine; only a budget that runs out can leave settings unmeasured, and the selection says so.
"""

import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from math import inf, isclose, isfinite

import mujoco
import numpy as np

from grader.numerics.accuracy.convergence import measure_distance, measure_position_distance
from grader.numerics.accuracy.reference import Reference, find_obstacle, list_sample_times, solve_dop853
from grader.numerics.integrators import BY_CODE, DISCRETE, EULER, IMPLICIT, IMPLICITFAST, RK4, Integrator, find_refusal
from grader.numerics.rollout import Rollout, simulate
from grader.numerics.scene import Scene, Vector
from grader.numerics.stepping import STEPS_MAX
from grader.studies.advise.measures import measure_quantity

SAMPLE_S = 0.02
"""Errors are evaluated at multiples of this; every timestep in TIMESTEPS_S divides it."""

TIMESTEPS_S = (0.0001, 0.0002, 0.00025, 0.0005, 0.001, 0.002, 0.0025, 0.004, 0.005, 0.01, 0.02)

PREFERENCE = (IMPLICITFAST, EULER, DISCRETE, IMPLICIT, RK4)
"""Preferred order at equal cost; the first is the one from which the lesson starts."""

START = (IMPLICITFAST, 0.002)
"""The setting from which the lesson starts; costs are relative to it."""

QUARTER = (RK4, 0.0005)
"""What the lesson tries next where energy is conserved."""

CONFIRMATIONS = 2
"""A timestep passes if this many of the next smaller ones pass too, so that none passes by accident."""

REFERENCE_SHARE = 0.1
"""The largest uncertainty of the reference, as a share of the tolerance, at which a choice is made."""

ACCEPTED_SHARE = 0.4
"""The same where halving has ended: every error then has the distance between different methods added."""

REDUCTION = 2.5
"""The factor by which a halving may reduce the uncertainty; where even that would not do, halving ends early."""

REFERENCE_S = (0.0002, 0.0001, 0.00005, 0.000025, 0.0000125)
"""Timesteps [s] of the reference where DOP853 cannot be used: halved until two of them agree."""

RTOLS = (1e-9, 1e-11, 1e-13)
"""Tolerances of DOP853: tightened until two of them agree."""

RK4_RATIO = 2
"""The timestep of RK4 relative to that of the method beside it: both then cost about the same."""

CORES = os.cpu_count() or 1
"""Runs at a time: mj_step releases Python's lock."""

Quantity = Callable[[mujoco.MjModel, mujoco.MjData], float]
Setting = tuple[Integrator, float]
"""An integrator and a timestep [s]."""

Say = Callable[[str], object]


@dataclass(frozen=True)
class Candidate:
    """A measured setting. `error` is inf for a run that diverged; `cost` counts evaluations per simulated second; `cpu`
    is the CPU time per simulated second of the one run, which the rest of the machine may disturb; `warning` names the
    first warning and its time."""

    integrator: Integrator
    timestep_s: float
    error: float
    cost: float
    cpu: float = field(default=0.0, compare=False)
    warning: str | None = None

    @property
    def setting(self) -> Setting:
        """The integrator and the timestep [s]."""
        return self.integrator, self.timestep_s


@dataclass(frozen=True)
class Selection:
    """The best candidate, or None, with the reason in words.

    `margin` is the tolerance over the error of the best; `reference_error` the uncertainty of the reference. `front`
    holds the candidates that no other beats in both cost and error, the cheapest first. `own` is the model's own
    setting. `told` is the smallest tolerance for which this reference could tell, None if there is no reference.
    """

    best: Candidate | None
    margin: float
    reason: str
    reference_error: float
    candidates: tuple[Candidate, ...]
    front: tuple[Candidate, ...] = ()
    own: Candidate | None = None
    told: float | None = None


class QuantityStill(ValueError):
    """The quantity moves by no more than the tolerance, so that an error says nothing."""


class OutOfTime(RuntimeError):
    """The budget is spent."""


class Touched(Exception):
    """A constraint acts, so that the equations are not smooth."""


def select(
    scene: Scene, *, tolerance: float, seconds: float, quantity: Quantity | None = None,
    integrators: Sequence[Integrator] = PREFERENCE, timesteps_s: Sequence[float] = TIMESTEPS_S,
    budget_s: float = inf, progress: Say = lambda _: None,
) -> Selection:  # fmt: skip
    """Measure candidates over `seconds` and choose the cheapest that meets `tolerance`.

    Errors are sup norms of `quantity`, by default of qpos. START, QUARTER and the model's own setting are always
    measured. Of each integrator the largest timestep comes first; it ends where a timestep passes and CONFIRMATIONS
    smaller ones confirm it, or where its next setting costs more than the best of another one. An integrator that
    MuJoCo refuses for the model is left out. No run begins that would last beyond `budget_s` of wall time; the best of
    what was measured is then returned.

    Raises ValueError as `check_question` does, and for timesteps that do not divide SAMPLE_S; Still where the quantity
    moves too little.
    """
    check_question(tolerance, seconds, timesteps_s)
    if any(not isclose(SAMPLE_S / h, round(SAMPLE_S / h)) for h in timesteps_s):
        raise ValueError(f"every timestep must divide {SAMPLE_S} s, at whose multiples errors are evaluated")
    if scene.model.nhistory:
        return _cannot_tell("a delay counts samples, so that runs at two timesteps are not comparable")
    with ThreadPoolExecutor(CORES) as pool:
        able = [integrator for integrator in integrators if find_refusal(scene.model, integrator) is None]
        offered = {integrator: sorted(timesteps_s, reverse=True) for integrator in able}
        meter, until = _Meter(scene, seconds, quantity), time.monotonic() + budget_s
        return _Survey(meter, tolerance, offered, until=until, progress=progress, pool=pool).select()


def check_question(tolerance: float, seconds: float, timesteps_s: Sequence[float] = TIMESTEPS_S) -> None:
    """Raise ValueError for a tolerance or length [s] that is not positive and finite, or a length of too many steps."""
    if not (0 < tolerance < inf and SAMPLE_S <= seconds < inf):
        raise ValueError(f"tolerance must be positive and the run {SAMPLE_S} s or longer")
    longest = STEPS_MAX * min(*timesteps_s, *REFERENCE_S)
    if not seconds <= longest:
        raise ValueError(f"the run may last {longest:g} s at most, not {seconds:g} s")


def describe_setting(candidate: Candidate) -> str:
    """Returns the setting in words, such as `implicitfast at 2 ms`."""
    return f"{candidate.integrator.name} at {1000 * candidate.timestep_s:.4g} ms"


def find_front(candidates: Sequence[Candidate]) -> tuple[Candidate, ...]:
    """Returns the candidates that no other beats in both cost and error (the Pareto front), the cheapest first."""
    front: list[Candidate] = []
    for candidate in sorted(candidates, key=lambda c: (c.cost, c.error, PREFERENCE.index(c.integrator))):
        if candidate.error < min((c.error for c in front), default=inf):
            front.append(candidate)
    return tuple(front)


def _cannot_tell(why: str, doubt: float = inf) -> Selection:
    told = doubt / REFERENCE_SHARE if isfinite(doubt) else None
    hint = "" if told is None else f"; a tolerance of {told:.1g} or more could be told"
    return Selection(None, 0.0, f"cannot tell: {why}{hint}", doubt, (), told=told)


@dataclass(frozen=True)
class _Run:
    """One run with its CPU time per simulated second."""

    rollout: Rollout
    cpu: float


class _Meter:
    """Runs a scene and measures errors against a reference, in positions or in a quantity."""

    def __init__(self, scene: Scene, seconds: float, quantity: Quantity | None) -> None:
        self.scene, self.quantity = scene, quantity
        self.grid_s = np.asarray(list_sample_times(seconds, SAMPLE_S))
        self.seconds = float(self.grid_s[-1])

    def times_of(self, timestep_s: float) -> Vector:
        """Returns the times [s] at which a run is compared: the steps nearest to the multiples of SAMPLE_S."""
        steps = np.unique(np.rint(self.grid_s / timestep_s))
        return np.asarray(steps[steps > 0] * timestep_s)

    def run(self, setting: Setting, at_s: Vector | None = None) -> _Run:
        integrator, timestep_s = setting
        times = self.times_of(timestep_s) if at_s is None else at_s
        begin = time.thread_time()
        rollout = simulate(
            self.scene, seconds=float(times[-1]), timestep_s=timestep_s, integrator=integrator.code, at_s=times
        )
        spent = time.thread_time() - begin
        return _Run(rollout, spent / max(rollout.steps * timestep_s, timestep_s))

    def reference_run(self, setting: Setting, times_s: Vector) -> Rollout:
        """Returns a run that is kept at the steps on both sides of every time."""
        timestep_s = setting[1]
        steps = times_s / timestep_s
        around = np.unique(np.concatenate([np.floor(steps + 1e-6), np.ceil(steps - 1e-6)]))
        return self.run(setting, np.asarray(around * timestep_s)).rollout

    def error(self, one: Rollout | Reference, other: Rollout | Reference) -> float:
        """Returns the sup norm of the difference at the times of `one`; inf if it diverged."""
        if isinstance(one, Rollout) and one.diverged_at_step is not None:
            return inf
        if isinstance(other, Rollout) and other.diverged_at_step is not None:
            return inf
        second = _interpolate(self.scene, other, one.time)
        if self.quantity is None:
            return measure_distance(self.scene, one, second).qpos
        values = (measure_quantity(self.scene, run, self.quantity) for run in (one, second))
        largest = float(np.max(np.abs(np.subtract(*values)), initial=0.0))
        return largest if isfinite(largest) else inf

    def excursion(self, run: Rollout) -> float:
        """How far the quantity moves from its start; inf for a run that diverged."""
        if run.diverged_at_step is not None:
            return inf
        if self.quantity is None:
            start = np.tile(self.scene.start.qpos, (len(run.qpos), 1))
            return measure_position_distance(self.scene, run.qpos, start)
        still = simulate(self.scene, steps=0)
        values = measure_quantity(self.scene, run, self.quantity)
        return float(np.max(np.abs(values - measure_quantity(self.scene, still, self.quantity)[0]), initial=0.0))


def _interpolate(scene: Scene, run: Rollout | Reference, times: Vector) -> Reference:
    """States at `times`, between two kept ones by linear interpolation. The reference keeps a state within one of its
    own timesteps on both sides of each time: the error is of second order in that timestep."""
    after = np.clip(np.searchsorted(run.time, times - 1e-9), 0, len(run.time) - 1)
    before = np.where(np.abs(run.time[after] - times) < 1e-9, after, np.maximum(after - 1, 0))
    width = run.time[after] - run.time[before]
    share = np.divide(times - run.time[before], width, out=np.zeros(len(times)), where=width > 0)[:, None]
    qpos, qvel, act = (
        (1 - share) * part[before] + share * part[after] if share.any() else part[after]
        for part in (run.qpos, run.qvel, run.act)
    )
    for row in qpos if share.any() else ():
        mujoco.mj_normalizeQuat(scene.model, row)
    return Reference(times, qpos, qvel, act)


def _extrapolate(scene: Scene, coarse: Reference, fine: Reference) -> Reference:
    """Returns the first-order extrapolation of two solutions at the same times, one at half the other's timestep."""
    qpos, qvel, act = (
        2 * b - a for a, b in ((coarse.qpos, fine.qpos), (coarse.qvel, fine.qvel), (coarse.act, fine.act))
    )
    for row in qpos:
        mujoco.mj_normalizeQuat(scene.model, row)
    return Reference(fine.time, qpos, qvel, act)


class _Survey:
    """Measures settings once each, within a budget of wall time. `offered` holds the timesteps [s] to choose from for
    each integrator, the largest first; `measured` what was found."""

    def __init__(
        self, meter: _Meter, tolerance: float, offered: Mapping[Integrator, Sequence[float]], *, until: float,
        progress: Say, pool: ThreadPoolExecutor,
    ) -> None:  # fmt: skip
        self.meter, self.tolerance, self.offered = meter, tolerance, offered
        self.until, self.progress, self.pool = until, progress, pool
        self.measured: dict[Setting, Candidate] = {}
        self.doubt = inf
        self.evaluation_s = 0.0
        self.unmeasured: list[Setting] = []

    def select(self) -> Selection:
        model = self.meter.scene.model
        own = (BY_CODE[int(model.opt.integrator)], float(model.opt.timestep))
        first = dict.fromkeys([START, QUARTER, own])
        self.progress("the first runs")
        self.meter.run(START)  # warms caches: the CPU time of the second run is the yardstick
        runs = dict(zip(first, self.pool.map(self.meter.run, first), strict=True))
        start = runs[START]
        self.evaluation_s = start.cpu * START[1] / START[0].evaluations
        moved = self.meter.excursion(start.rollout)
        if moved <= self.tolerance:
            raise QuantityStill(
                f"the {'positions' if self.meter.quantity is None else 'quantity'} "
                + ("never move" if moved == 0 else f"move by {moved:.2g} only")
                + f" within {self.meter.seconds:g} s, and a tolerance of {self.tolerance:g} allows any method"
            )
        times = np.unique(np.concatenate([self.meter.times_of(h) for h in (own[1], SAMPLE_S)]))
        try:
            reference = self.reference(times)
        except RuntimeError as error:
            return _cannot_tell(str(error))
        if not self.doubt <= ACCEPTED_SHARE * self.tolerance:
            much = f"too much for a tolerance of {self.tolerance:g}"
            return _cannot_tell(f"the reference itself is uncertain by {self.doubt:.2g}, {much}", self.doubt)
        self.take(runs, reference)
        self.refine(reference)
        return self.choose(own)

    def take(self, runs: Mapping[Setting, _Run], reference: Rollout | Reference) -> None:
        """Hold runs against the reference."""
        self.measured |= {setting: self.candidate(setting, run, reference) for setting, run in runs.items()}

    def candidate(self, setting: Setting, run: _Run, reference: Rollout | Reference) -> Candidate:
        integrator, timestep_s = setting
        rollout, warning = run.rollout, None
        if rollout.diverged_at_step is not None:
            name = rollout.warning.name if rollout.warning is not None else "time ran backwards"
            warning = f"{name} after {rollout.steps * timestep_s:.3g} s"
        error = self.meter.error(rollout, reference)
        return Candidate(integrator, timestep_s, error, integrator.evaluations / timestep_s, run.cpu, warning)

    def reference(self, times_s: Vector) -> Rollout | Reference:
        """Returns the reference solution; `doubt` becomes its distance to solutions of another method or timestep.

        Uses DOP853 at two tolerances where no constraint acts along the whole motion, else RK4, confirmed by itself at
        twice the timestep and by a method of first order.
        """
        if find_obstacle(self.meter.scene) is None or self.starts_free():
            try:
                return self.solve_smooth(times_s)
            except Touched:
                self.progress("a constraint acts: the reference needs steps")
        return self.step_pairs(times_s)

    def starts_free(self) -> bool:
        """Whether constraints are all that hinders DOP853, and none acts at the start."""
        scene = self.meter.scene
        if find_obstacle(scene, constraints=False) is not None:
            return False
        with scene.borrow() as workspace:
            mujoco.mj_forward(workspace.model, workspace.data)
            return int(workspace.data.nefc) == 0

    def solve_smooth(self, times_s: Vector) -> Reference:
        """Returns the first solution by DOP853 with which the one before agrees, or the last. Raises Touched."""
        best: Reference | None = None
        for finer in self.solve(times_s):
            if best is not None:
                self.doubt = self.meter.error(self.keep(best, times_s), finer)
                if self.doubt <= REFERENCE_SHARE * self.tolerance:
                    return finer
            best = finer
        assert best is not None
        return best

    def step_pairs(self, times_s: Vector) -> Reference | Rollout:
        """Returns a run of RK4 at ever smaller timesteps, beside one of a first-order method at half of each.

        Euler takes the place of RK4 where that does not run. Ends where the uncertainty is small enough, where no
        further halving can make it so, or before the budget does.
        """
        self.doubt, fourth = inf, RK4 if RK4 in self.offered else EULER
        best: Rollout | None = None
        before: tuple[Rollout, Rollout] | None = None
        for finest_s in REFERENCE_S:
            settings = ((fourth, RK4_RATIO * finest_s if fourth is RK4 else finest_s), (PREFERENCE[0], finest_s))
            if not self.lasts(sum(map(self.predicted, settings)) / min(CORES, 2)):
                break
            self.progress(f"the reference: {fourth.name} and {PREFERENCE[0].name} at {1e6 * finest_s:g} us")
            high, low = self.pool.map(self.meter.reference_run, settings, [times_s] * 2)
            if high.diverged_at_step is not None and fourth is RK4:  # too stiff for an explicit method
                fourth, before = EULER, None
                high = self.meter.reference_run((EULER, finest_s), times_s)
            doubt = inf if before is None else self.measure_doubt(times_s, before, (high, low))
            if best is None or doubt < self.doubt:
                self.doubt, best = doubt, high
            if self.doubt <= REFERENCE_SHARE * self.tolerance or self.is_hopeless(doubt, finest_s):
                break
            before = high, low
        if best is None or before is None:
            raise OutOfTime("the budget is too small for a reference solution")
        return best

    def is_hopeless(self, doubt: float, finest_s: float) -> bool:
        """Whether the halvings that are left cannot reduce the uncertainty enough, judged from the third pair on."""
        left = sum(h < finest_s for h in REFERENCE_S)
        least = doubt / REDUCTION**left
        return isfinite(doubt) and finest_s < REFERENCE_S[1] and least > ACCEPTED_SHARE * self.tolerance

    def measure_doubt(self, times_s: Vector, before: tuple[Rollout, Rollout], now: tuple[Rollout, Rollout]) -> float:
        """Returns the largest distance of the RK4 run to the one before, and to the method of first order or, where
        that is nearer, its extrapolation: errors of different methods do not cancel."""
        if any(run.diverged_at_step is not None for run in (*before, *now)):
            return inf
        high, low = (self.keep(run, times_s) for run in now)
        coarser, lower = (self.keep(run, times_s) for run in before)
        extrapolated = _extrapolate(self.meter.scene, lower, low)
        itself = self.meter.error(coarser, high)
        return max(itself, min(self.meter.error(low, high), self.meter.error(extrapolated, high)))

    def keep(self, run: Rollout | Reference, times_s: Vector) -> Reference:
        """Returns the states of a run at `times_s` after the start."""
        return _interpolate(self.meter.scene, run, times_s + self.meter.scene.start.time_s)

    def solve(self, times_s: Vector) -> Iterator[Reference]:
        """Solutions by DOP853 at ever tighter tolerances, as long as the budget lasts."""

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

    def predicted(self, setting: Setting) -> float:
        """Returns the expected time [s] of a run on one core."""
        return self.evaluation_s * setting[0].evaluations * self.meter.seconds / setting[1]

    def lasts(self, seconds: float) -> bool:
        return time.monotonic() + seconds <= self.until

    def refine(self, reference: Rollout | Reference) -> None:
        """Measure ever smaller timesteps of every integrator that can still be the best."""
        while True:
            best = self.best()
            wanted = [one for integrator in self.offered if (one := self.next_of(integrator, best)) is not None]
            fitting = [setting for setting in wanted if self.lasts(self.predicted(setting))]
            self.unmeasured = [setting for setting in wanted if setting not in fitting]
            if not fitting:
                return
            fitting.sort(key=lambda setting: setting[0].evaluations / setting[1])
            batch = fitting[:CORES]
            self.progress(f"{len(self.measured)} settings measured")
            self.take(dict(zip(batch, self.pool.map(self.meter.run, batch), strict=True)), reference)

    def next_of(self, integrator: Integrator, best: Candidate | None) -> Setting | None:
        """The next smaller timestep of an integrator; None once one is confirmed, or where none can beat `best`."""
        if self.confirmed(integrator) is not None:
            return None
        offered = self.offered[integrator]
        tried = {h: self.measured[integrator, h] for h in offered if (integrator, h) in self.measured}
        smallest_failed = min((h for h, one in tried.items() if not self.passes(one)), default=inf)
        left = [h for h in offered if h < smallest_failed]
        if not left or (best is not None and integrator.evaluations / left[0] > best.cost):
            return None
        return next(((integrator, h) for h in left if h not in tried), None)

    def confirmed(self, integrator: Integrator) -> Candidate | None:
        """Returns the largest timestep that passes, with CONFIRMATIONS smaller ones, or all that there are."""
        offered = self.offered[integrator]
        for index in range(len(offered)):
            row = [self.measured.get((integrator, h)) for h in offered[index : index + 1 + CONFIRMATIONS]]
            if all(one is not None and self.passes(one) for one in row):
                return row[0]
        return None

    def passes(self, candidate: Candidate) -> bool:
        return candidate.error + self.doubt <= self.tolerance

    def by_accident(self, candidate: Candidate) -> bool:
        """Whether a smaller timestep of the same integrator does not pass."""
        own = (one for one in self.measured.values() if one.integrator is candidate.integrator)
        return any(one.timestep_s < candidate.timestep_s and not self.passes(one) for one in own)

    def best(self) -> Candidate | None:
        """Returns the cheapest confirmed setting."""
        return min(filter(None, map(self.confirmed, self.offered)), key=_rank, default=None)

    def choose(self, own: Setting) -> Selection:
        """Returns the selection among what was measured."""
        candidates = tuple(sorted(self.measured.values(), key=_rank))
        best = self.best()
        late = "" if not self.unmeasured else "; the budget ended before all settings were measured"
        if best is None:
            least = min(candidates, key=lambda c: c.error)
            margin, reason = 0.0, f"none of the candidates meets {self.tolerance:g}"
            if isfinite(least.error):
                reason += f"; the best, {describe_setting(least)}, has an error of {least.error:.2g}"
        else:
            margin = self.tolerance / best.error if best.error else inf
            cost = f"{best.cost:g} evaluations a second"
            reason = f"{describe_setting(best)} meets {self.tolerance:g} with an error of {best.error:.2g} at {cost}"
            cheaper = [c for c in candidates if c.cost < best.cost]
            if lucky := [describe_setting(c) for c in cheaper if self.passes(c) and self.by_accident(c)]:
                reason += f"; cheaper, but by accident, as a smaller timestep is worse: {', '.join(lucky)}"
        told = self.doubt / REFERENCE_SHARE
        front = find_front(candidates)
        return Selection(best, margin, reason + late, self.doubt, candidates, front, self.measured[own], told)


def _rank(candidate: Candidate) -> tuple[float, int]:
    """Returns the order of choice: the cheapest first, then by preference."""
    return candidate.cost, PREFERENCE.index(candidate.integrator)
