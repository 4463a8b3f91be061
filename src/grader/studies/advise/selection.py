"""Select the cheapest integrator and timestep that meet a tolerance on a scene, by measured error.

This is the lesson's procedure with a reference solution: refine until a quantity no longer changes by more than the
tolerance, and take the largest timestep below that point. Every setting is measured once, the cheapest first, on all
cores. Cost is counted in evaluations of the forward dynamics per simulated second, so that the choice does not depend
on the load of the machine; only a budget that runs out can leave settings unmeasured, and the selection says so.
"""

import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from itertools import takewhile
from math import ceil, floor, inf, isclose, isfinite, log10, nan

import numpy as np
from numpy.typing import NDArray

from grader.numerics.accuracy.reference import Reference
from grader.numerics.integrators import BY_CODE, DISCRETE, EULER, IMPLICIT, IMPLICITFAST, RK4, Integrator, find_refusal
from grader.numerics.rollout import Rollout
from grader.numerics.scene import Scene, Vector
from grader.numerics.stepping import STEPS_MAX
from grader.studies.advise.meter import SAMPLE_S, Meter, Quantity, Run, Setting, choose_interval
from grader.studies.advise.references import CORES, REFERENCE_S, REFERENCE_SHARE, UNTIL_MIN_S, References, Say

TIMESTEPS_S = (0.0001, 0.0002, 0.00025, 0.0005, 0.001, 0.002, 0.0025, 0.004, 0.005, 0.01, 0.02)

PREFERENCE = (IMPLICITFAST, EULER, DISCRETE, IMPLICIT, RK4)
"""Preferred order at equal cost; the first is the one from which the lesson starts."""

START = (IMPLICITFAST, 0.002)
"""The setting from which the lesson starts; costs are relative to it."""

QUARTER = (RK4, 0.0005)
"""What the lesson tries next where energy is conserved."""

CONFIRMATIONS = 2
"""A timestep passes if this many of the next smaller ones pass too, so that none passes by accident. The smallest but
one is confirmed by the smallest, and that by half of it, which is no choice."""

PROBED_S = 0.001
"""Timesteps [s] from this one on are all measured, from the largest down: they cost little, and draw the diagram."""


@dataclass(frozen=True)
class Candidate:
    """A measured setting. `error` is inf for a run that diverged; `cost` counts evaluations per simulated second; `cpu`
    is the CPU time per simulated second of the one run, which the rest of the machine may disturb; `warning` names the
    first warning and its time. With `confirms` it was measured to confirm a larger timestep only, and is no choice."""

    integrator: Integrator
    timestep_s: float
    error: float
    cost: float
    cpu: float = field(default=0.0, compare=False)
    warning: str | None = None
    confirms: bool = False

    @property
    def setting(self) -> Setting:
        """The integrator and the timestep [s]."""
        return self.integrator, self.timestep_s


@dataclass(frozen=True)
class Selection:
    """The best candidate, or None, with the reason in words.

    `margin` is the tolerance over the error of the best; `reference_error` the uncertainty of the reference. `front`
    holds what `find_front` finds. `own` is the model's own setting. `told` is the smallest tolerance for which this
    reference could tell, None if there is no reference. `reference` says how that was made; errors are held against
    `tolerance`. `until_s` is the time [s] up to which it is certain enough, None for the whole run: the choice is then
    for that time. Runs were compared every `interval_s`.
    """

    best: Candidate | None
    margin: float
    reason: str
    reference_error: float
    candidates: tuple[Candidate, ...]
    front: tuple[Candidate, ...] = ()
    own: Candidate | None = None
    told: float | None = None
    reference: str = ""
    tolerance: float = nan
    until_s: float | None = None
    interval_s: float = SAMPLE_S


class QuantityStill(ValueError):
    """The quantity moves by no more than the tolerance, so that an error says nothing."""


def select(
    scene: Scene, *, tolerance: float, seconds: float, quantity: Quantity | None = None,
    integrators: Sequence[Integrator] = PREFERENCE, timesteps_s: Sequence[float] = TIMESTEPS_S,
    budget_s: float = inf, progress: Say = lambda _: None,
) -> Selection:  # fmt: skip
    """Measure candidates over `seconds` and choose the cheapest that meets `tolerance`.

    Errors are sup norms of `quantity`, by default of qpos. START, QUARTER and the model's own setting are always
    measured. Of each integrator the largest timestep comes first; it ends where its next setting costs more than the
    cheapest that passes. CONFIRMATIONS smaller timesteps must confirm that one, and half the smallest confirms the
    smallest. An integrator that MuJoCo refuses for the model is left out. No run begins that would last beyond
    `budget_s` of wall time; the best of what was measured is then returned.

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
        meter, until = Meter(scene, seconds, quantity, choose_interval(seconds)), time.monotonic() + budget_s
        chosen = _Survey(meter, tolerance, offered, until=until, progress=progress, pool=pool).select()
        return replace(chosen, interval_s=meter.interval_s)


def check_question(tolerance: float, seconds: float, timesteps_s: Sequence[float] = TIMESTEPS_S) -> None:
    """Raise ValueError for a tolerance or length [s] that is not positive and finite, or a length of too many steps."""
    if not (0 < tolerance < inf and SAMPLE_S <= seconds < inf):
        raise ValueError(f"tolerance must be positive and the run {SAMPLE_S} s or longer")
    longest = STEPS_MAX * min(min(timesteps_s) / 2, *REFERENCE_S)
    if not seconds <= longest:
        raise ValueError(f"the run may last {longest:g} s at most, not {seconds:g} s")


def describe_setting(candidate: Candidate) -> str:
    """Returns the setting in words, such as `implicitfast at 2 ms`."""
    return f"{candidate.integrator.name} at {1000 * candidate.timestep_s:.4g} ms"


def write_error(error: float, doubt: float, form: str = ".2g", below: str = "below ") -> str:
    """Returns an error that is finite, such as `0.0012`. One below the uncertainty of the reference says only that the
    true one is no larger than their sum, such as `below 8.8e-05`, which is rounded up."""
    if error >= doubt:
        return f"{error:{form}}"
    digit = 10.0 ** (floor(log10(error + doubt)) - 1)
    return f"{below}{ceil((error + doubt) / digit) * digit:{form}}"


def describe_error(error: float, doubt: float) -> str:
    """Returns the same in words: `an error of 0.0012` or `an error below 8.8e-05`."""
    return f"an error {'of ' if error >= doubt else ''}{write_error(error, doubt)}"


def find_front(candidates: Sequence[Candidate], doubt: float) -> tuple[Candidate, ...]:
    """Returns the candidates that no other beats in both cost and error (the Pareto front), the cheapest first. Errors
    below the uncertainty of the reference, `doubt`, are all the same."""
    front: list[Candidate] = []
    lowest = inf
    choices = (candidate for candidate in candidates if not candidate.confirms)
    for candidate in sorted(choices, key=lambda c: (c.cost, max(c.error, doubt), PREFERENCE.index(c.integrator))):
        if max(candidate.error, doubt) < lowest:
            lowest = max(candidate.error, doubt)
            front.append(candidate)
    return tuple(front)


def _cannot_tell(why: str, doubt: float = inf) -> Selection:
    told = doubt / REFERENCE_SHARE if isfinite(doubt) else None
    return Selection(None, 0.0, f"cannot tell: {why}{_hint(told or inf)}", doubt, (), told=told)


def _describe_limit(why: str, told: float, until_s: float) -> str:
    return f"cannot tell beyond {until_s:g} s: {why}{_hint(told)}; until {until_s:g} s "


def _hint(told: float) -> str:
    return f"; a tolerance of {told:.1g} or more could be told" if isfinite(told) else ""


class _Survey:
    """Measures settings once each, within a budget of wall time. `offered` holds the timesteps [s] to choose from for
    each integrator, the largest first; `measured` what was found; `confirming` the settings that are no choice."""

    def __init__(
        self, meter: Meter, tolerance: float, offered: Mapping[Integrator, Sequence[float]], *, until: float,
        progress: Say, pool: ThreadPoolExecutor,
    ) -> None:  # fmt: skip
        self.meter, self.tolerance, self.offered = meter, tolerance, offered
        self.until, self.progress, self.pool = until, progress, pool
        self.measured: dict[Setting, Candidate] = {}
        self.doubt = inf
        self.evaluation_s = 0.0
        self.unmeasured: list[Setting] = []
        self.confirming = set[Setting]()

    def select(self) -> Selection:
        model = self.meter.scene.model
        own = (BY_CODE[int(model.opt.integrator)], float(model.opt.timestep))
        first = dict.fromkeys([START, QUARTER, own])
        self.progress("the first runs")
        Meter(self.meter.scene, SAMPLE_S, None).run(START)  # warms caches: CPU times are yardsticks
        runs = dict(zip(first, self.pool.map(self.meter.run, first), strict=True))
        start = runs[START]
        # The least, as what disturbs a run only adds to its time.
        self.evaluation_s = min(run.cpu * h / method.evaluations for (method, h), run in runs.items())
        moved = self.meter.excursion(start.rollout)
        if moved <= self.tolerance:
            what, ending = ("positions", "") if self.meter.quantity is None else ("quantity", "s")
            raise QuantityStill(
                f"the {what} "
                + (f"never move{ending}" if moved == 0 else f"move{ending} by {moved:.2g} only")
                + f" within {self.meter.seconds:g} s, and a tolerance of {self.tolerance:g} allows any method"
            )
        times = np.unique(np.concatenate([self.meter.times_of(own[1]), self.meter.grid_s]))
        search = References(
            self.meter, self.tolerance, frozenset(self.offered), first=[runs[START].rollout, runs[QUARTER].rollout],
            until=self.until, evaluation_s=self.evaluation_s, progress=self.progress, pool=self.pool,
        )  # fmt: skip
        try:
            solution = search.find(times)
        except RuntimeError as error:
            return _cannot_tell(str(error))
        self.doubt, told, until_s = float(solution.doubts[-1]), float(solution.doubts[-1]) / REFERENCE_SHARE, None
        reason = ""
        if not search.accepts(self.doubt):
            reason = search.explain(solution, times)
            until_s = self.shorten(times, solution.doubts, search.accepts(solution.doubts), start, own)
            if until_s is None:
                return _cannot_tell(reason, self.doubt)
            runs = {setting: self.meter.cut(run) for setting, run in runs.items()}
            reason = _describe_limit(reason, told, until_s)
        self.take(runs, solution.states)
        self.refine(solution.states)
        chosen = self.choose(own)
        return replace(
            chosen, reason=reason + chosen.reason, told=told if isfinite(told) else None, reference=solution.method,
            tolerance=self.tolerance, until_s=until_s,
        )  # fmt: skip

    def shorten(
        self, times: Vector, doubts: Vector, accepted: NDArray[np.bool_], start: Run, own: Setting
    ) -> float | None:  # fmt: skip
        """Measure only as long as the reference is certain enough [s]; None where nothing can be told of that time."""
        if not accepted.any():
            return None
        interval_s = self.meter.interval_s
        seconds = interval_s * int(times[accepted][-1] / interval_s + 1e-6)
        if seconds < max(UNTIL_MIN_S, 2 * own[1]):
            return None
        shorter = Meter(self.meter.scene, seconds, self.meter.quantity, interval_s)
        if shorter.excursion(shorter.cut(start).rollout) <= self.tolerance:
            return None
        self.meter, self.doubt = shorter, float(doubts[times <= seconds + 1e-9][-1])
        return seconds

    def take(self, runs: Mapping[Setting, Run], reference: Rollout | Reference) -> None:
        """Hold runs against the reference."""
        self.measured |= {setting: self.candidate(setting, run, reference) for setting, run in runs.items()}

    def candidate(self, setting: Setting, run: Run, reference: Rollout | Reference) -> Candidate:
        integrator, timestep_s = setting
        rollout, warning = run.rollout, None
        if rollout.diverged_at_step is not None:
            name = rollout.warning.name if rollout.warning is not None else "time ran backwards"
            warning = f"{name} after {rollout.steps * timestep_s:.3g} s"
        error = self.meter.error(rollout, reference)
        cost, confirms = integrator.evaluations / timestep_s, setting in self.confirming
        return Candidate(integrator, timestep_s, error, cost, run.cpu, warning, confirms)

    def predicted(self, setting: Setting) -> float:
        """Returns the expected time [s] of a run on one core."""
        return self.evaluation_s * setting[0].evaluations * self.meter.seconds / setting[1]

    def lasts(self, seconds: float) -> bool:
        return time.monotonic() + seconds <= self.until

    def refine(self, reference: Rollout | Reference) -> None:
        """Measure what may cost less than the cheapest setting that passes so far; then what confirms that one."""
        while True:
            cheapest = min(filter(None, map(self.find_passing, self.offered)), key=_rank, default=None)
            limit = inf if cheapest is None else cheapest.cost
            wanted = [pair for integrator in self.offered if (pair := self.next_of(integrator, limit)) is not None]
            if not wanted and cheapest is not None:
                wanted = [(cheapest.integrator, h) for h in self.list_confirming(cheapest)]
                wanted = [setting for setting in wanted if setting not in self.measured]
                self.confirming |= {(i, h) for i, h in wanted if h not in self.offered[i]}
            fitting = [setting for setting in wanted if self.lasts(self.predicted(setting))]
            self.unmeasured = [setting for setting in wanted if setting not in fitting]
            if not fitting:
                return
            fitting.sort(key=lambda setting: setting[0].evaluations / setting[1])
            batch = fitting[:CORES]
            self.progress(f"{len(self.measured)} settings measured")
            self.take(dict(zip(batch, self.pool.map(self.meter.run, batch), strict=True)), reference)

    def next_of(self, integrator: Integrator, limit: float) -> Setting | None:
        """Returns the next smaller timestep of an integrator that costs no more than `limit`; None where none is left.

        It is the smallest of them where errors that shrink with the timestep would not pass even there: if that fails,
        the ones between need no run.
        """
        tried = {h: self.measured[integrator, h] for h in self.offered[integrator] if (integrator, h) in self.measured}
        smallest_failed = min((h for h, candidate in tried.items() if not self.passes(candidate)), default=inf)
        untried = [h for h in self.offered[integrator] if h < smallest_failed and h not in tried]
        left = [h for h in untried if integrator.evaluations / h <= limit]
        if not left:
            return None
        above = tried.get(smallest_failed)
        if above is None or left[0] >= PROBED_S or above.error * left[-1] / smallest_failed <= self.tolerance:
            return integrator, left[0]
        return integrator, left[-1]

    def find_passing(self, integrator: Integrator) -> Candidate | None:
        """Returns the largest timestep that passes with every smaller one that was measured."""
        offered = self.offered[integrator]
        tried = (self.measured.get((integrator, h)) for h in (min(offered) / 2, *reversed(offered)))
        passing = list(takewhile(self.passes, filter(None, tried)))
        return passing[-1] if passing and passing[-1].timestep_s in offered else None

    def list_confirming(self, candidate: Candidate) -> list[float]:
        """Returns the smaller timesteps that must pass too: half of the smallest where no smaller one is offered."""
        smaller = [h for h in self.offered[candidate.integrator] if h < candidate.timestep_s]
        return smaller[:CONFIRMATIONS] or [candidate.timestep_s / 2]

    def best(self) -> Candidate | None:
        """Returns the cheapest setting that passes, with those that confirm it."""
        passing = filter(None, map(self.find_passing, self.offered))
        confirmed = (
            candidate
            for candidate in passing
            if all((candidate.integrator, h) in self.measured for h in self.list_confirming(candidate))
        )
        return min(confirmed, key=_rank, default=None)

    def passes(self, candidate: Candidate) -> bool:
        return candidate.error + self.doubt <= self.tolerance

    def by_accident(self, candidate: Candidate) -> bool:
        """Whether a smaller timestep of the same integrator does not pass."""
        own = (other for other in self.measured.values() if other.integrator is candidate.integrator)
        return any(other.timestep_s < candidate.timestep_s and not self.passes(other) for other in own)

    def explain_none(self, candidates: Sequence[Candidate]) -> str:
        """Returns why no candidate is chosen: that of the best one."""
        reason = f"none of the candidates meets {self.tolerance:g}"
        least = min((c for c in candidates if not c.confirms), key=lambda c: c.error)
        name = f"the best, {describe_setting(least)},"
        if least.error == inf:
            return reason
        if not self.passes(least):
            return f"{reason}; {name} has an error of {self.describe_excess(least)}"
        smaller = [c for c in candidates if c.integrator is least.integrator and c.timestep_s < least.timestep_s]
        worse = max((c for c in smaller if not self.passes(c)), key=lambda c: c.error, default=None)
        reason += f" for certain; {name} has {describe_error(least.error, self.doubt)}, but "
        if worse is None:
            return reason + "no smaller timestep was measured that confirms it"
        what = "diverges" if worse.error == inf else f"has one of {self.describe_excess(worse)}"
        return f"{reason}by accident, as {describe_setting(worse)} {what}"

    def describe_excess(self, candidate: Candidate) -> str:
        """Returns the error of a candidate that does not pass, with what is added to it where that makes it so."""
        if candidate.error > self.tolerance:
            return _write_over(candidate.error, self.tolerance)
        total = _write_over(candidate.error + self.doubt, self.tolerance)
        return f"{candidate.error:.2g}, with the uncertainty of the reference, {self.doubt:.2g}, added {total}"

    def choose(self, own: Setting) -> Selection:
        """Returns the selection among what was measured."""
        candidates = tuple(sorted(self.measured.values(), key=_rank))
        best = self.best()
        late = "" if not self.unmeasured else "; the budget ended before all settings were measured"
        if best is None:
            margin, reason = 0.0, self.explain_none(candidates)
        else:
            margin = self.tolerance / best.error if best.error else inf
            cost = f"{best.cost:g} evaluations a second"
            error = describe_error(best.error, self.doubt)
            reason = f"{describe_setting(best)} meets {self.tolerance:g} with {error} at {cost}"
            cheaper = [c for c in candidates if c.cost < best.cost]
            if lucky := [describe_setting(c) for c in cheaper if self.passes(c) and self.by_accident(c)]:
                reason += f"; cheaper, but by accident, as a smaller timestep is worse: {', '.join(lucky)}"
        front = find_front(candidates, self.doubt)
        return Selection(best, margin, reason + late, self.doubt, candidates, front, self.measured[own])


def _write_over(size: float, limit: float) -> str:
    """Returns a number above `limit` with two digits, or as many as show that."""
    texts = (f"{size:.{digits}g}" for digits in range(2, 17))
    return next((text for text in texts if float(text) > limit), repr(size))


def _rank(candidate: Candidate) -> tuple[float, int]:
    """Returns the order of choice: the cheapest first, then by preference."""
    return candidate.cost, PREFERENCE.index(candidate.integrator)
