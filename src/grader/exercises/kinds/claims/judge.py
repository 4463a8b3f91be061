"""Judges claims: compares each with what we measured."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from grader.exercises.judgement import Judgement, Part, Results, tell_to_convert
from grader.exercises.kinds.claims.measuring import MeasuredClaim, measure_claims
from grader.exercises.kinds.claims.parameters import Claim, Floats, Problem

FIGURES = 7
ALL_RIGHT = "Every claim agrees with our own measurement."


@dataclass(frozen=True, eq=False)
class ClaimComparison:
    """One claim of the learner's with what we measured. `values` is None where nothing was read, and `text` stands for
    what was returned instead. `why` is empty where the claim is right."""

    claim: Claim
    values: Floats | None
    text: str
    measured: MeasuredClaim
    why: str = ""
    detail: str = ""

    @property
    def allowed(self) -> float:
        """The largest difference at which it is right, with our own uncertainty."""
        return self.claim.allow(self.measured.values) + self.measured.uncertainty


Outcome = tuple[ClaimComparison, ...]


def judge_claims(problem: Problem, results: Results) -> Judgement[Outcome]:
    """Returns the judgement on a case: a part for each claim. Raises ValueError where we could not measure."""
    measured = measure_claims(problem)
    if lost := [measurement for measurement in measured if not np.isfinite(measurement.values).all()]:
        raise ValueError(f"this case cannot be measured: {lost[0].trouble}")
    outcome = tuple(
        compare(problem, claim, results, index, measured[index]) for index, claim in enumerate(problem.claims)
    )
    wrong = [comparison for comparison in outcome if comparison.why]
    parts = tuple(describe(comparison) for comparison in outcome)
    message = wrong[0].why if wrong else ALL_RIGHT
    if len(parts) == 1:
        (part,) = parts
        return Judgement(part.passed, message, outcome, part.detail, part.measured, part.expected)
    return Judgement(not wrong, message, outcome, parts=parts)


def compare(problem: Problem, claim: Claim, results: Results, index: int, measured: MeasuredClaim) -> ClaimComparison:
    """Returns the comparison of one claim."""
    values = results.get(f"c{index}")
    if values is None or values.dtype != np.float64 or not np.isfinite(values).all():
        other = results.get(f"other{index}", np.empty(0, np.uint8))
        text = other.tobytes()[:200].decode(errors="replace") or "nothing"
        wanted = {"number": "a finite number", "interval": "two finite numbers, low and high",
                  "curve": "a finite number for each x"}[claim.form]  # fmt: skip
        why = f"The function must return {claim.name} as {wanted}{tell_to_convert(text)}."
        return ClaimComparison(claim, None, text, measured, why, f"It gave {text}.")
    count = problem.count_values(claim)
    if values.size != count:
        asked = "one number is" if count == 1 else f"{count} numbers are"
        why = f"{capitalize(claim.label)} has the wrong shape: {asked} asked for."
        return ClaimComparison(claim, None, f"an array of shape {values.shape}", measured, why)
    got = np.array(values, dtype=np.float64).reshape(count)
    why, detail = (judge_interval if claim.form == "interval" else judge_numbers)(claim, got, measured)
    return ClaimComparison(claim, got, "", measured, why, detail)


def judge_numbers(claim: Claim, got: Floats, measured: MeasuredClaim) -> tuple[str, str]:
    """Returns what is wrong with a number or a curve: without numbers, and with."""
    allowed = claim.allow(measured.values) + measured.uncertainty
    if any(compute_size(claim, got - right) <= allowed for right in measured.rights):
        return "", ""
    off = got - measured.values
    size = compute_size(claim, off)
    worst = off[int(np.abs(off).argmax())]
    is_off_alike = np.all(off > allowed) or np.all(off < -allowed)
    where = "" if len(off) == 1 else "everywhere " if is_off_alike else "in places "
    why = f"{capitalize(claim.label)} is {where}too {'high' if worst > 0 else 'low'}."
    returned = f"You returned {got[0]:.5g}{prefix_unit(claim)}. " if len(got) == 1 else ""
    return why, f"{returned}It is off by {size:.3g}{prefix_unit(claim)}; {allowed:.2g}{prefix_unit(claim)} is allowed."


def compute_size(claim: Claim, off: Floats) -> float:
    """Returns the size of differences in the norm of a claim."""
    return float(np.sqrt(np.mean(off**2))) if claim.norm == "rms" else float(np.abs(off).max())


def judge_interval(claim: Claim, got: Floats, measured: MeasuredClaim) -> tuple[str, str]:
    """Returns what is wrong with an interval: without numbers, and with."""
    low, high = float(got[0]), float(got[1])
    right, around = float(measured.values[0]), claim.allow(measured.values) + measured.uncertainty
    assert claim.width is not None
    if low > high:
        return f"The interval for {claim.label} begins at its upper end: the lower one comes first.", ""
    slack = around if claim.rule == "overlaps" else measured.uncertainty
    if not any(low - slack <= most and least <= high + slack for least, most in list_measurable(claim, measured)):
        return f"The interval for {claim.label} lies too {'high' if low > right else 'low'}.", ""
    if high - low > claim.width * (1 + 1e-9):
        asked = f"{claim.width:g}{prefix_unit(claim)}"
        return (
            f"The interval for {claim.label} is too wide.",
            f"It is {high - low:.3g} wide, and {asked} was asked for.",
        )
    return "", ""


def list_measurable(claim: Claim, measured: MeasuredClaim) -> list[tuple[float, float]]:
    """Returns the ranges of the numbers that an interval may hold. A run at the model's own timestep gives one number,
    and ever shorter timesteps give another. A learner may measure any number between them, if the two agree as well as
    the claim asks."""
    own = measured.own if claim.timestep == "both" else measured.values
    if np.abs(own - measured.values).max() > claim.allow(measured.values):
        own = measured.values  # drawn where the claim jumps: what is between the two is no measurement
    ends = [float(own[0]), float(measured.values[0])]
    return [(min(ends), max(ends)), *((float(other[0]), float(other[0])) for other in measured.others)]


def describe(comparison: ClaimComparison) -> Part:
    """Returns the finding of one claim."""
    claim = comparison.claim
    got = comparison.text if comparison.values is None else to_json(comparison.values)
    right = to_json(comparison.measured.values)
    message = comparison.why or "It agrees with our own measurement."
    return Part(claim.name, claim.label, not comparison.why, message, comparison.detail, got, right, claim.points)


def to_json(values: Floats) -> Any:
    """Returns a number, or a list of them, to seven figures."""
    figures = [float(f"{value:.{FIGURES}g}") for value in values.tolist()]
    return figures[0] if len(figures) == 1 else figures


def prefix_unit(claim: Claim) -> str:
    """Returns the unit of a claim with the space that separates it from a number; empty for no unit."""
    return f" {claim.unit}" if claim.unit else ""


def capitalize(text: str) -> str:
    """Returns a text whose first letter is large, unless it is a symbol such as `h`."""
    return text[:1].upper() + text[1:] if len(text.split(maxsplit=1)[0]) > 1 else text
