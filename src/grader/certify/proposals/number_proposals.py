"""Proposes a `verify` for a number: each quantity of a run that the words of the question and its unit allow is
computed at the model's own timestep; what comes near the key is certified as any key is."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import isfinite
from time import thread_time
from typing import Any, Literal, get_args

import numpy as np
from pydantic import ValidationError

from grader.certify.measurement_keys import find_scale
from grader.certify.proposals.expressions import FittedExpression, fit_unit
from grader.certify.proposals.proposal import Proposal, write_verify
from grader.certify.proposals.scenes import LabScene, ShownExpression, read_numbers
from grader.certify.proposals.thresholds import list_thresholds
from grader.certify.proposals.trying import BROKEN, certify_with
from grader.certify.wording import AskedQuantities, read_question, read_words
from grader.domain.lab import SECONDS_MAX
from grader.domain.quantities import BASE_UNITS, QuantityName, Summary, Window
from grader.domain.verify import ByMeasurement, ByThreshold
from grader.experiments.quantities import Floats, measure
from grader.experiments.runs import VerifyError
from grader.questions import ModelXml, NumberKey
from grader.questions.kinds.number.quantities import format_number
from grader.questions.kinds.number.units import known_unit

Measured = Literal["end", Summary]

TRIED_MAX = 4
"""Candidates that are certified: about ten runs each."""

CPU_S_MAX = 10.0
"""CPU time after which no further candidate is certified [s]."""

NEAR = 1.5
"""Distance from the key, in tolerances, at the model's own timestep, up to which a candidate is certified: the limit of
a shorter timestep may be nearer."""

MOMENTS_MAX = 2
LEVELS_MAX = 3

PLAIN: tuple[Measured, ...] = ("end", "max", "min", "mean", "amplitude", "peak_to_peak", "period", "frequency")
"""What is tried where the words ask for nothing."""

NAMES = {
    "end": "the value", "max": "the largest value", "min": "the smallest value", "mean": "the mean",
    "rms": "the effective value", "amplitude": "the amplitude", "peak_to_peak": "the distance from peak to peak",
    "crossing": "the moment of a crossing", "crossings": "the number of crossings", "period": "the period",
    "frequency": "the frequency", "decay_rate": "the decay rate", "settling": "the settling time",
}  # fmt: skip

ABOUT = {
    "both": "", "given": ", for the run at the model's own timestep alone", "any": ", for shorter timesteps alone",
}  # fmt: skip
"""What a key may be about, with the caution that belongs to it; the most that is shown first."""


@dataclass(frozen=True)
class NumberCandidate:
    """A `verify` with the number that it gives at the model's own timestep, in the unit of the key, and how sentences
    call it. `rank` is how well it fits the words and the unit; `is_telling` says that it fits so well that another
    number is worth a remark."""

    verify: ByMeasurement | ByThreshold
    value: float
    what: str
    rank: int
    is_telling: bool


def propose_for_number(key: NumberKey, scenes: Sequence[LabScene], model_xml: ModelXml, text: str) -> Proposal | None:
    """Returns the most specific candidate under which the key is certified, else the nearest of those that fit best and
    tell something; None without any."""
    asked = read_question(text)
    candidates = [candidate for scene in scenes for candidate in list_candidates(key, asked, scene, model_xml)]
    if not candidates:
        return None
    candidates.sort(key=lambda candidate: -candidate.rank)
    near = [candidate for candidate in candidates if abs(candidate.value - key.answer) <= NEAR * key.tolerance]
    last = thread_time() + CPU_S_MAX
    for candidate in near[:TRIED_MAX]:
        proposal = propose_certified(key, candidate, model_xml, len(candidates), len(near) - 1)
        if proposal is not None:
            return proposal
        if thread_time() > last:
            break
    fits_best = [candidate for candidate in candidates if candidate.rank == candidates[0].rank]
    nearest = min(fits_best, key=lambda candidate: measure_distance(candidate.value, key.answer))
    agrees = abs(nearest.value - key.answer) <= key.tolerance
    caution = ", which simulation does not know to a fifth of the tolerance" if agrees else ""
    if not nearest.is_telling:
        return None
    return build_proposal(key, nearest, len(candidates), caution, holds=False)


def propose_certified(
    key: NumberKey, candidate: NumberCandidate, model_xml: ModelXml, compared: int, rivals: int
) -> Proposal | None:
    """Returns the proposal of a candidate under which the key is certified, about the motion or else about the run at
    the model's own timestep; None where it is not."""
    for timestep, about in ABOUT.items() if isinstance(candidate.verify, ByMeasurement) else [("both", "")]:
        verify = candidate.verify if timestep == "both" else candidate.verify.model_copy(update={"timestep": timestep})
        certificate = certify_with(key, verify, model_xml)
        if certificate is not None and certificate.ok and certificate.answer is not None:
            others = f"; {rivals} more come{'s' * (rivals == 1)} near it: read which one is meant" if rivals else ""
            measured = replace(candidate, verify=verify, value=certificate.answer)
            return build_proposal(key, measured, compared, about + others, holds=True)
    return None


def build_proposal(key: NumberKey, candidate: NumberCandidate, compared: int, caution: str, *, holds: bool) -> Proposal:
    """Returns a proposal with the numbers as people read them: never alike where they differ."""
    unit = key.unit or ""
    gives, says = format_number(candidate.value, key.answer), format_number(key.answer, candidate.value)
    return Proposal(
        write_verify(candidate.verify),
        holds,
        candidate.what,
        f"{gives} {unit}".strip(),
        f"{says} {unit}".strip(),
        compared,
        caution,
    )


def measure_distance(value: float, answer: float) -> float:
    """Returns how far two numbers are apart, as a share of the larger one."""
    return abs(value - answer) / max(abs(value), abs(answer), 1e-300)


def list_candidates(
    key: NumberKey, asked: AskedQuantities, scene: LabScene, model_xml: ModelXml
) -> list[NumberCandidate]:
    """Returns every candidate of a simulation, none where it cannot be run."""
    if asked.is_timestep:
        return [
            NumberCandidate(*threshold, rank=5, is_telling=True) for threshold in list_thresholds(key, scene, model_xml)
        ]
    try:
        return list(NumberSearch(key.unit, asked, scene).list_candidates())
    except BROKEN:
        return []


@dataclass(frozen=True)
class NumberSearch:
    """The quantities of one run of a simulation that are in the unit of a question and that its words allow."""

    unit: str | None
    asked: AskedQuantities
    scene: LabScene

    @property
    def where(self) -> str:
        """Whose simulation it is, where it is not the question's own."""
        name = self.scene.lab.title or self.scene.lab.model
        return "" if self.scene.is_own else f" of {f'“{name}”' if name else 'a simulation'} in the same lesson"

    @property
    def names(self) -> list[Measured]:
        """The quantities that may be meant."""
        wanted = [name for name in get_args(Measured) if name in self.asked.quantities] or PLAIN
        return [name for name in wanted if can_be_in(name, self.unit)]

    def list_candidates(self) -> Iterator[NumberCandidate]:
        """Yields the candidates. Raises what `LabScene.run` does."""
        names = self.names
        fitted = list(self.fit(self.scene.list_shown())) or list(self.fit(self.scene.list_joints()))
        if not fitted or not names:
            return
        moments = [value for value in self.asked.moments_s if value <= SECONDS_MAX][:MOMENTS_MAX]
        lengths = list(dict.fromkeys([*moments, *([] if moments and names == ["end"] else [self.scene.seconds])]))
        run = self.scene.run([fit.expr for fit in fitted], max(lengths))
        if run.warnings:
            return
        times = np.array(run.times)
        for quantity, column in zip(fitted, run.readouts, strict=True):
            values = read_numbers(column)
            for name in names if np.isfinite(values).all() else ():
                for seconds in lengths:
                    yield from self.measure(quantity, name, seconds, times, values)

    def fit(self, shown: Sequence[ShownExpression]) -> Iterator[FittedExpression]:
        """Yields the expressions that are in the unit; as they are where a quantity is read from moments alone."""
        for expression in shown:
            fitted = fit_unit(expression, self.scene.model, self.unit)
            if fitted is not None and any(name not in BASE_UNITS for name in self.names):
                yield fitted
            elif any(name in BASE_UNITS for name in self.names):
                yield FittedExpression(expression.expr, expression, None, is_certain=False)

    def measure(
        self, fit: FittedExpression, name: Measured, seconds: float, times: Floats, values: Floats
    ) -> Iterator[NumberCandidate]:
        """Yields a quantity of a series in the first `seconds` of a run, by each level or band that may be meant."""
        is_of_moments = name in BASE_UNITS
        if fit.factor is None and not is_of_moments:
            return
        rank = self.rank(fit, name, seconds)
        is_telling = self.scene.is_own or (fit.is_certain and name in self.asked.quantities)
        quantity: QuantityName = "final" if name == "end" else name
        forms = [(fit.expr, "", values)] if is_of_moments else list_forms(fit, self.asked, values)
        seen = set[tuple[float, str]]()
        for expr, form, series in forms:
            for more in list_windows(name, self.asked, fit):
                value = measure(quantity, times, series, Window(until=seconds, **more))
                verify = write_measurement(self.scene, expr, name, seconds, more)
                if isfinite(value) and verify is not None and (value, str(more)) not in seen:
                    seen.add((value, str(more)))
                    window = describe_window(name, seconds, more)
                    what = f"{NAMES[name]}{form} of “{fit.shown.label}”{window}{self.where}"
                    yield NumberCandidate(verify, find_scale(name, self.unit) * value, what, rank, is_telling)

    def rank(self, fit: FittedExpression, name: str, seconds: float) -> int:
        """Returns how well a candidate fits: the quantity is asked for, the unit is certain, the label and the moment
        stand in the question."""
        words = min(len(read_words(fit.shown.label) & self.asked.words), 2)
        is_asked, is_named = name in self.asked.quantities, seconds in self.asked.moments_s
        return 3 * is_asked + 2 * fit.is_certain + words + is_named + self.scene.is_own + min(self.scene.named, 2)


def list_forms(fit: FittedExpression, asked: AskedQuantities, values: Floats) -> Iterator[tuple[str, str, Floats]]:
    """Yields an expression as it is, where the question asks for a size without its sign, and where it asks for a
    distance from its start."""
    yield fit.expr, "", values
    if asked.is_unsigned and (values < 0).any():
        yield f"Math.abs({fit.expr})", " without sign", np.abs(values)
    start = float(f"{values[0]:.9g}")
    if asked.is_far and start:
        yield f"Math.abs({fit.expr} - {start!r})".replace("- -", "+ "), " from the start", np.abs(values - start)


def list_windows(name: str, asked: AskedQuantities, fit: FittedExpression) -> Iterator[dict[str, Any]]:
    """Yields by what a quantity is measured: levels and bands that the question names, and 0."""
    unit = fit.shown.unit
    named = [(amount, amount.to(unit) if unit else amount.value) for amount in asked.amounts]
    if name in ("crossing", "crossings"):
        levels = [value for amount, value in named if value is not None and not amount.is_width]
        for level in dict.fromkeys([*levels[: LEVELS_MAX - 1], 0.0]):
            yield from ({"level": level, "direction": way} for way in ("up", "down", "either"))
    elif name == "settling":
        bands = [abs(value) for amount, value in named if value and amount.is_width]
        yield from ({"band": band} | more for band in bands for more in ({}, {"level": 0.0}))
    else:
        yield {}


def describe_window(name: str, seconds: float, more: dict[str, Any]) -> str:
    """Returns by what a quantity is measured, as the end of its name."""
    parts = [f" {value}" if key == "direction" else f" {key} {value:g}" for key, value in more.items()]
    return "".join(parts) + (f" at {seconds:g} s" if name == "end" else f" within {seconds:g} s")


def can_be_in(name: str, unit: str | None) -> bool:
    """Whether a quantity can be in a unit: a period is no length, and needs a unit of time."""
    try:
        find_scale(name, unit)
    except VerifyError:
        return False
    return not BASE_UNITS.get(name) or known_unit(unit or "") is not None


def write_measurement(
    scene: LabScene, expr: str, name: Measured, seconds: float, more: dict[str, Any]
) -> ByMeasurement | None:
    """Returns a `verify`, None where the lab cannot be written as one."""
    named = {"xml": scene.lab.xml} if scene.lab.xml else {"model": scene.lab.model}
    given = {"key": scene.lab.key, "setup": scene.setup, "controller": scene.lab.controller}
    try:
        return ByMeasurement.model_validate(
            {"by": "measurement", **named, **given, "expr": expr, "when": name, "seconds": seconds, **more}
        )
    except ValidationError:
        return None
