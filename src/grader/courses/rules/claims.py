"""The numbers and brackets that learners claim, on the axes of a question: read from the evidence of verdicts. Evidence
is stored JSON, possibly of an older version, so what cannot be read is left out. Pure."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from grader.questions import NumberKey, Question, kind_of

MS = "ms"

WITHOUT_DAMPING = "the limit without damping"


class Claim(NamedTuple):
    """A bracket; a number is one whose ends are equal. `low` is NaN where the learner said that there is no limit."""

    low: float
    high: float

    @property
    def middle(self) -> float:
        """The middle of the bracket."""
        return (self.low + self.high) / 2

    @property
    def is_none(self) -> bool:
        """Whether the learner said that there is none."""
        return math.isnan(self.low)


NO_LIMIT = Claim(math.nan, math.nan)


@dataclass(frozen=True)
class ClaimAxis:
    """An axis on which a question's claims lie, in `unit`. Claims within `right` are right, None where it is unknown or
    there is no limit; `is_limit` says that a bracket has to hold it. `marks` are values with names, such as that of a
    formula that is often taken."""

    id: str
    title: str
    unit: str
    right: tuple[float, float] | None = None
    is_limit: bool = False
    marks: tuple[tuple[str, float], ...] = ()

    def accepts(self, claim: Claim) -> bool:
        """Whether a claim is right on this axis."""
        if self.right is None:
            return self.is_limit and claim.is_none
        low, high = self.right
        if self.is_limit:
            return claim.low <= high * (1 + 1e-3) and claim.high >= low * (1 - 1e-3)
        return low <= claim.low <= claim.high <= high


def list_number_axes(question: Question) -> list[ClaimAxis]:
    """Returns the axes of a question that asks for numbers; none for any other."""
    kind = kind_of(question)
    numbers = kind.numbers(question)
    keys = [key for key in kind.answer_keys(question) if isinstance(key, NumberKey)]
    if not numbers or len(numbers) != len(keys):
        return []
    return [
        ClaimAxis(
            f"n{place}", number.text or "The answer", number.unit,
            (key.answer - key.tolerance, key.answer + key.tolerance),
        )
        for place, (number, key) in enumerate(zip(numbers, keys, strict=True))
    ]  # fmt: skip


def list_bracket_axes(verdict: Mapping[str, Any]) -> list[ClaimAxis]:
    """Returns the axes of the limits in the evidence of a verdict on a script; none without any."""
    limits = {one["case"]: one for one in list_parts(verdict, "limits", "case")}
    titles = {one.get("id"): one.get("title") for one in verdict.get("findings") or ()}
    axes = []
    for one in list_parts(verdict, "claims", "case"):
        case, limit = one["case"], limits.get(one["case"], {})
        low, high, spring = (read_number(limit.get(name)) for name in ("linear_ms", "within_ms", "spring_ms"))
        right = None if low is None or high is None else (low, high)
        marks = () if right is None or spring is None else ((WITHOUT_DAMPING, spring),)
        axes.append(ClaimAxis(case, str(titles.get(case) or case), MS, right, is_limit=True, marks=marks))
    return axes


def read_claims(verdict: Mapping[str, Any], axes: Sequence[ClaimAxis]) -> dict[str, Claim]:
    """Returns what a verdict says was claimed, by axis."""
    known = {axis.id: axis for axis in axes}
    claims: dict[str, Claim] = {}
    for one in list_parts(verdict, "claims", "case"):
        claim = read_bracket(one)
        if claim is not None:
            claims[one["case"]] = claim
    value = (verdict.get("evidence") or {}).get("value")
    for place, given in enumerate(value if isinstance(value, list) else [value]):
        axis, number = known.get(f"n{place}"), read_number(given)
        if axis is not None and number is not None:
            claims[axis.id] = Claim(number, number)
        elif axis is not None and axis.right is not None and isinstance(value, list):  # a right one of several
            claims[axis.id] = Claim(*[sum(axis.right) / 2] * 2)
    return {axis: claim for axis, claim in claims.items() if axis in known}


def read_bracket(claim: Mapping[str, Any]) -> Claim | None:
    """Returns the bracket of a claim in the evidence; None where nothing was claimed."""
    ends = claim.get("claim_ms")
    numbers = [read_number(end) for end in ends] if isinstance(ends, list) else []
    if len(numbers) == 2 and numbers[0] is not None and numbers[1] is not None:
        return Claim(numbers[0], numbers[1])
    return NO_LIMIT if claim.get("said_none") else None


def list_parts(verdict: Mapping[str, Any], name: str, key: str) -> list[dict[str, Any]]:
    """Returns the objects with a key in a list of the evidence."""
    found = (verdict.get("evidence") or {}).get(name)
    return [one for one in found if isinstance(one, dict) and key in one] if isinstance(found, list) else []


def read_number(value: Any) -> float | None:
    """Returns a finite number; None for any other value."""
    is_number = isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
    return float(value) if is_number else None


def merge_axes(several: Iterable[Sequence[ClaimAxis]]) -> list[ClaimAxis]:
    """Returns the axes of many verdicts, each once; where one verdict knows the limit, it is known."""
    merged: dict[str, ClaimAxis] = {}
    for axes in several:
        for axis in axes:
            before = merged.get(axis.id)
            if before is None or (before.right is None and axis.right is not None):
                merged[axis.id] = axis
    return list(merged.values())
