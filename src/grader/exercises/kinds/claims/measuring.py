"""Measures the claims of a case, as answer keys are: at the model's own timestep, at ever shorter ones until the limit
is known, and from nudged starts. A run is shared by the claims that it serves, and what was measured is kept."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from typing import Any

import numpy as np

from grader.domain.lab import LabConfig, Readout, Slider
from grader.errors import LabRefused
from grader.exercises.kinds.claims.parameters import Claim, Experiment, Floats, Problem
from grader.exercises.parameters import WrongParameter, WrongParameters
from grader.experiments.limits import (
    UNCERTAINTY_SHARE,
    describe_noise,
    explain_change,
    explain_unsettled,
    find_limit,
    list_other_ends,
    measure_nudged,
)
from grader.experiments.quantities import WAVES, explain_absence, measure, measure_waves, read_trace
from grader.experiments.regime import RegimeFailure, describe_reset
from grader.experiments.runs import SAME, LabRun, Variant, VerifyError, run_experiment, to_numbers

STEPS_MAX = 20_000
"""Most steps at the model's own timestep in all runs of a case: seconds of computing, with those at shorter ones."""

GRAZES = 0.05
"""The share of its band by which a peak may miss the edge of it, and either settling time is right."""

MEASURED_MAX = 64
"""Cases whose measurements are kept."""

KEYS = {"setup": "setup", "controller": "controller", "readouts": "expr", "controls": "x.apply"}

Reader = Callable[[Variant], tuple[LabRun, Floats]]
"""Returns the run of an experiment, and what its expressions gave: an array (frames, expressions)."""


@dataclass(frozen=True, eq=False)
class MeasuredClaim:
    """What a claim should be, in its unit: `values`, one for each x of a curve, with the largest uncertainty, and `own`
    at the model's own timestep. `trouble` is the key and the reason why it cannot be decided; empty where it can.
    `finest` is the own timestep over the shortest one, for each x. `others` are numbers that are as right, as in a
    case that was drawn where the claim jumps."""

    values: Floats
    uncertainty: float
    own: Floats
    trouble: tuple[str, str] | None = None
    finest: tuple[float, ...] = ()
    others: tuple[Floats, ...] = ()

    @property
    def rights(self) -> tuple[Floats, ...]:
        """All numbers that are right."""
        return self.values, *self.others


def read_series(experiment: Experiment, exprs: Sequence[str], variant: Variant) -> tuple[LabRun, Floats]:
    """Returns a run with a frame for every step, and what the expressions gave: (frames, expressions). Raises
    RegimeFailure where MuJoCo reset the state, VerifyError and LabRefused where it cannot be carried out."""
    return run_config(build_config(experiment, tuple(exprs)), experiment, variant)


@lru_cache(maxsize=256)
def build_config(experiment: Experiment, exprs: tuple[str, ...]) -> LabConfig:
    """Returns an experiment as a lab with these readouts."""
    apply, value = experiment.apply, experiment.value
    sliders = () if apply is None else (Slider(label="x", min=value, max=value, value=value, apply=apply, init=True),)
    return LabConfig(
        xml=experiment.xml,
        key=experiment.key,
        setup=experiment.setup or None,
        controller=experiment.controller,
        controls=sliders,
        readouts=tuple(Readout(label=text, expr=text) for text in exprs),
    )


def run_config(config: LabConfig, experiment: Experiment, variant: Variant) -> tuple[LabRun, Floats]:
    """Returns the run of an experiment and its readouts, as `read_series` does."""
    variant = replace(variant, every_step=True)
    run = run_experiment(config, experiment.xml, seconds=experiment.seconds, variant=variant, keys=KEYS)
    if run.warnings:
        raise RegimeFailure("no reset", describe_reset(run))
    return run, np.stack([to_numbers(column) for column in run.readouts], axis=1)


class Bench:
    """The runs of a case, each made once. A run is shared by all claims with the same experiment."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self._exprs: dict[Experiment, list[str]] = {}
        for claim in problem.claims:
            for experiment in problem.list_experiments(claim):
                exprs = self._exprs.setdefault(experiment, [])
                exprs += [] if claim.expr in exprs else [claim.expr]
        self.read = cache(self._read)
        self.steps = 0

    def _read(self, experiment: Experiment, variant: Variant) -> tuple[LabRun, Floats]:
        run, series = read_series(experiment, self._exprs[experiment], variant)
        if variant == SAME:
            self.steps += run.steps
            if self.steps > STEPS_MAX:
                why = f"the runs of a case take more than {STEPS_MAX} steps of the model's timestep: measure less long"
                raise VerifyError("seconds", why)
        return run, series

    def measure(
        self, claim: Claim, experiment: Experiment, variant: Variant, at_s: float = 0.0
    ) -> tuple[LabRun, float]:
        """Returns a run, and the claim's number in it. Raises RegimeFailure where it has none."""
        try:
            run, series = self.read(experiment, variant)
            column = series[:, self._exprs[experiment].index(claim.expr)]
        except VerifyError as error:
            if error.key != "expr":
                raise
            run, series = read_series(experiment, [claim.expr], variant)  # whose expression it is
            column = series[:, 0]
        value = read_value(claim, np.array(run.times), column, at_s)
        if not np.isfinite(value):
            raise RegimeFailure("finite", explain_missing(claim, column))
        return run, value


def explain_missing(claim: Claim, values: Floats) -> str:
    """Returns why a series has not the number of a claim."""
    if not np.isfinite(values).any():
        return f"{claim.expr} never gives one finite number: look at its index, or choose one number of several"
    return explain_absence(claim.quantity, claim.expr)


def read_value(claim: Claim, times: Floats, values: Floats, at_s: float = 0.0) -> float:
    """Returns the number of a claim in a series, in its unit; NaN where the series does not have it. `at_s` is the
    moment of a trace."""
    if claim.quantity == "trace":
        return claim.scale * float(read_trace(times, values, np.array([at_s]))[0])
    return claim.scale * measure(claim.quantity, times, values, claim)


def list_points(problem: Problem, claim: Claim) -> list[tuple[Experiment, float]]:
    """Returns the run and the moment of each number of a claim."""
    experiments = problem.list_experiments(claim)
    if claim.quantity == "trace":
        return [(experiments[0], at_s) for at_s in problem.x]
    return [(experiment, 0.0) for experiment in experiments]


def measure_own(bench: Bench, index: int) -> Floats:
    """Returns the numbers of a claim at the model's own timestep. Raises as `Bench.measure` does."""
    claim = bench.problem.claims[index]
    points = list_points(bench.problem, claim)
    return np.array([bench.measure(claim, experiment, SAME, at_s)[1] for experiment, at_s in points])


def rehearse_claims(problem: Problem) -> None:
    """Raises WrongParameters where claims have no number at the model's own timestep, or where what learners may give
    in its place has none."""
    bench, errors = Bench(problem), list[WrongParameter]()
    for index, claim in enumerate(problem.claims):
        try:
            measure_own(bench, index)
        except (RegimeFailure, LabRefused, VerifyError) as error:
            errors.append(WrongParameter(*place_error(index, error)))
        else:
            errors += check_wrong_readings(problem, index, claim)
    if errors:
        raise WrongParameters(errors)


def check_wrong_readings(problem: Problem, index: int, claim: Claim) -> Iterator[WrongParameter]:
    """Yields what is wrong with the expressions that learners may read in place of a claim."""
    exprs = {f"instead.{at}.expr": other.expr for at, other in enumerate(claim.instead)}
    if claim.formula is not None:
        exprs["formula.expr"] = claim.formula.expr
    for key, expr in exprs.items():
        try:
            _, series = read_series(problem.list_experiments(claim)[0], [expr], SAME)
        except VerifyError as error:
            yield WrongParameter(f"claims.{index}.{key}", str(error))
        else:
            if not np.isfinite(series[0]).all():
                yield WrongParameter(f"claims.{index}.{key}", "it gives no finite number at the start")


def measure_claims(problem: Problem) -> tuple[MeasuredClaim, ...]:
    """Returns what every claim of a case should be; kept for equal cases."""
    return _measure_kept(ProblemKey(problem, (problem.claims, problem.axis, problem.seconds, problem.xml, problem.x,
                                        repr(sorted(problem.start.items())))))  # fmt: skip


@dataclass(frozen=True)
class ProblemKey:
    """A problem, compared by what it holds."""

    problem: Problem
    key: tuple[Any, ...]

    def __hash__(self) -> int:
        return hash(self.key)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, ProblemKey) and self.key == other.key


@lru_cache(maxsize=MEASURED_MAX)
def _measure_kept(key: ProblemKey) -> tuple[MeasuredClaim, ...]:
    bench = Bench(key.problem)
    return tuple(measure_claim(bench, index) for index in range(len(key.problem.claims)))


def measure_claim(bench: Bench, index: int) -> MeasuredClaim:
    """Returns what one claim should be, with the trouble if there is any."""
    claim = bench.problem.claims[index]
    points = list_points(bench.problem, claim)
    nothing = np.full(len(points), np.nan)
    own = nothing
    try:
        own = measure_own(bench, index)
        allowed = claim.allow(own)
        if claim.timestep == "given":
            return measure_given(bench, index, own, allowed)
        limits = [
            find_limit(
                lambda variant, one=one, at_s=at_s: bench.measure(claim, one, variant, at_s),  # type: ignore[misc]
                UNCERTAINTY_SHARE * allowed,
                to_the_end=claim.quantity == "final",
                fastest=claim.fastest,
            )
            for one, at_s in points
        ]
    except (RegimeFailure, LabRefused, VerifyError) as error:
        return MeasuredClaim(nothing, 0.0, own, place_error(index, error))
    worst = max(limits, key=lambda limit: limit.uncertainty)
    values = np.array([limit.value for limit in limits])
    trouble = explain_doubt(index, worst.uncertainty, allowed, worst.cure)
    if trouble is None and claim.timestep == "both" and (off := float(np.abs(own - values).max())) > allowed:
        why = (
            f"the run at the model's own timestep is off by {off:.3g}, and {allowed:.3g} is allowed: shorten the "
            "model's timestep, raise rtol or tol, or write timestep any, or given for a claim about the discretisation"
        )
        trouble = f"claims.{index}.timestep", why
    others = (own, *measure_grazes(bench, claim)) if claim.timestep == "both" else measure_grazes(bench, claim)
    apart = tuple(other for other in others if np.abs(other - values).max() > allowed)
    finest = tuple(limit.ladder.finest for limit in limits)
    return MeasuredClaim(values, worst.uncertainty, own, trouble, finest, apart)


def measure_grazes(bench: Bench, claim: Claim) -> tuple[Floats, ...]:
    """Returns settling times into a band that is a little narrower and wider: half a swing apart where a peak grazes
    the band. Whose place of rest is another last value then gets the other one."""
    if claim.quantity != "settling":
        return ()
    bands = [claim.model_copy(update={"band": (claim.band or 0.0) * factor}) for factor in (1 - GRAZES, 1 + GRAZES)]
    points = list_points(bench.problem, claim)
    try:
        return tuple(
            np.array([bench.measure(band, experiment, SAME, at_s)[1] for experiment, at_s in points]) for band in bands
        )
    except RegimeFailure:  # it leaves the narrower one at the end
        return ()


def measure_given(bench: Bench, index: int, own: Floats, allowed: float) -> MeasuredClaim:
    """Returns a claim about the discretisation itself: only nudged starts are varied. Raises as `Bench.measure`."""
    claim = bench.problem.claims[index]
    points = list_points(bench.problem, claim)
    nudged = [
        measure_nudged(lambda variant, one=one, at_s=at_s: bench.measure(claim, one, variant, at_s))  # type: ignore[misc]
        for one, at_s in points
    ]
    noise = max(float(np.abs(np.array(each) - value).max()) for each, value in zip(nudged, own, strict=True))
    trouble = explain_doubt(index, noise, allowed, describe_noise(noise))
    others = tuple(other for other in measure_derived(bench, claim) if np.abs(other - own).max() > allowed)
    return MeasuredClaim(own, noise, own, trouble, (1.0,) * len(points), others)


def measure_derived(bench: Bench, claim: Claim) -> tuple[Floats, ...]:
    """Returns the numbers of a claim by the state at which each step ends: mj_step leaves energies and poses of the
    state at which it began, and who computes them from positions and velocities gets those of its end."""
    points = list_points(bench.problem, claim)
    try:
        numbers = [bench.measure(claim, experiment, Variant(derived=True), at_s)[1] for experiment, at_s in points]
    except RegimeFailure:
        return ()
    return (np.array(numbers),)


def explain_doubt(index: int, uncertainty: float, allowed: float, cure: str) -> tuple[str, str] | None:
    """Returns the trouble of a claim that is not known to a fifth of its tolerance."""
    if uncertainty <= UNCERTAINTY_SHARE * allowed:
        return None
    known = f"it is known to {uncertainty:.2g} only, more than a fifth of what is allowed, {allowed:.2g}"
    return f"claims.{index}", f"{known}: {cure}"


def find_ambiguity(problem: Problem, index: int, measured: MeasuredClaim) -> tuple[str, str] | None:
    """Returns the trouble of a claim that was measured, and is another one for who looks at one wave of the run, or at
    a longer run. A verdict needs none of it."""
    claim = problem.claims[index]
    runs = zip(list_points(problem, claim), measured.finest, measured.own, strict=True)
    allowed = claim.allow(measured.own)
    try:
        whys = (explain_ambiguity(claim, experiment, finest, own, allowed) for (experiment, _), finest, own in runs)
        why = next(filter(None, whys), None)
    except (RegimeFailure, LabRefused, VerifyError) as error:
        return place_error(index, error)
    return None if why is None else (f"claims.{index}", why)


def explain_ambiguity(claim: Claim, experiment: Experiment, finest: float, own: float, allowed: float) -> str | None:
    """Says how the number of a claim depends on what is looked at; None where it does not. `finest` is the own timestep
    over the shortest one. Raises as `read_series` does."""
    if claim.quantity in WAVES:
        run, series = read_series(experiment, [claim.expr], Variant(finer=finest))
        times, values = np.array(run.times), series[:, 0]
        waves = claim.scale * measure_waves(claim.quantity, times, values, claim)
        return explain_change(claim.quantity, waves, read_value(claim, times, values), allowed)
    if claim.quantity == "settling":
        is_part = claim.until is not None
        ends = list_other_ends(claim.until or experiment.seconds, is_part=is_part)
        others = {end: read_until(claim, experiment, end) for end in ends}
        return explain_unsettled(own, others, allowed, is_part=is_part)
    return None


def place_error(index: int, error: Exception) -> tuple[str, str]:
    """Returns the key of the exercise for an error of a run, and the reason."""
    key = error.key if isinstance(error, VerifyError) else "verify"
    return key if key in ("x.apply", "seconds") else f"claims.{index}.{key}".removesuffix(".verify"), str(error)


def read_until(claim: Claim, experiment: Experiment, end_s: float) -> float:
    """Returns the number of a claim about the whole of a run that ends at another time [s]. Raises as `read_series`."""
    run, series = read_series(replace(experiment, seconds=end_s), [claim.expr], SAME)
    return read_value(claim.model_copy(update={"until": None}), np.array(run.times), series[:, 0])
