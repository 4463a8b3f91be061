"""Certificate: the result of deriving an answer key again by simulation, with the measurements."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from grader.questions import NumberKey

CERTAINLY = 3.0
"""Uncertainties by which a derived value must miss the tolerance before it refutes a key."""

UNCERTAINTY_SHARE = 0.2
"""Largest numerical uncertainty of a certified key, as a share of the tolerance."""

Verdict = Literal["certified", "refuted", "cannot tell"]


@dataclass(frozen=True)
class Certificate:
    """Whether the key holds, and why, in a sentence.

    `answer` is the derived option index or number, or None. `uncertainty` and `tolerance` are in the question's unit,
    None for options. `measured` is plain JSON. `remarks` are notes for the author, not faults. `key` is the key of the
    question to which a refusal belongs: `answer`, or one of `verify` if that cannot be carried out. `cost_ms` is
    informative only.
    """

    ok: bool
    why: str
    method: str
    answer: int | float | None
    expected: int | float
    measured: Mapping[str, Any] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()
    uncertainty: float | None = None
    tolerance: float | None = None
    cost_ms: float = 0.0
    key: str = "answer"
    undecided: bool = False
    regime: Mapping[str, Any] = field(default_factory=dict)

    @property
    def verdict(self) -> Verdict:
        """`certified`, `refuted` (the simulation gives another answer), or `cannot tell`, which `why` explains."""
        return "certified" if self.ok else "cannot tell" if self.undecided else "refuted"

    def to_json(self) -> dict[str, Any]:
        """Plain JSON."""
        return {
            "ok": self.ok,
            "verdict": self.verdict,
            "regime": dict(self.regime),
            "why": self.why,
            "method": self.method,
            "answer": self.answer,
            "expected": self.expected,
            "measured": dict(self.measured),
            "remarks": list(self.remarks),
            "uncertainty": self.uncertainty,
            "tolerance": self.tolerance,
            "cost_ms": round(self.cost_ms, 3),
        }


def refuse(method: str, expected: int | float, why: str, key: str = "verify") -> Certificate:
    """Returns a certificate for a key that could not be derived again."""
    return Certificate(False, " ".join(why.split()), method, None, expected, key=key, undecided=True)


def certify_number(
    method: str,
    key: NumberKey,
    derived: float,
    uncertainty: float,
    measured: Mapping[str, Any],
    *,
    cure: str = "",
) -> Certificate:
    """Certify a number: the derived value is within the tolerance, and its uncertainty below a fifth of it."""
    expected, tolerance = key.answer, key.tolerance
    values = f"derived {derived:.9g} with an uncertainty of {uncertainty:.2g}"
    off, undecided = abs(derived - expected), False
    if off - CERTAINLY * uncertainty > tolerance:
        why, ok = f"{values}, but the key says {expected:g} within {tolerance:g}", False
    elif not uncertainty <= UNCERTAINTY_SHARE * tolerance:
        why, ok = f"{values}, more than a fifth of the tolerance {tolerance:g}: the key cannot be decided", False
        why, undecided = (f"{why}: {cure}" if cure else why), True
    elif not off + uncertainty <= tolerance:
        why, ok = f"{values}, but the key says {expected:g} within {tolerance:g}", False
        undecided = off <= tolerance
    else:
        why, ok = f"{values}; the key {expected:g} is within {tolerance:g}", True
    why = why if ok else f"{why}; measured: {format_measurements(measured)}"
    remarks = (
        (f"The key differs by {off:.3g} from the derived value, {derived:.9g}.",) if ok and off > tolerance / 2 else ()
    )
    return Certificate(
        ok, why, method, derived, expected, measured, remarks, uncertainty, tolerance, undecided=undecided
    )


def certify_choice(
    method: str, right: list[int], expected: int, options: tuple[str, ...], measured: Mapping[str, Any]
) -> Certificate:
    """Certify an option: exactly one is right, and it is the key."""
    answer = right[0] if len(right) == 1 else None
    ok = answer == expected
    if answer is None:
        names = ", ".join(repr(options[i]) for i in right) or "no option"
        why = f"{names} came out right, not exactly one"
    else:
        said = "as the key says" if ok else f"but the key says {options[expected]!r}"
        why = f"{options[answer]!r} came out right, {said}"
    if not ok:
        why += f"; measured: {format_measurements(measured)}"
    return Certificate(ok, why, method, answer, expected, measured)


def format_measurements(measured: Mapping[str, Any]) -> str:
    """Returns the measurements as one line of text."""
    return "; ".join(f"{name}: {value}" for name, value in measured.items())
