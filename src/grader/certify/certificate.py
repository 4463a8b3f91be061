"""Certificate: the result of deriving an answer key again by simulation, with the measurements."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from grader.experiments.limits import UNCERTAINTY_SHARE
from grader.questions import NumberKey

CERTAINLY = 3.0
"""Uncertainties by which a derived value must miss the tolerance before it refutes a key."""

Verdict = Literal["certified", "refuted", "cannot tell"]


@dataclass(frozen=True)
class Certificate:
    """Whether the key holds, and why, in a sentence.

    `answer` is the derived option index or number, or None. `uncertainty` and `tolerance` are in the question's unit,
    None for options. `measured` is plain JSON, and so is `regime`: what was checked of the runs, and which condition
    failed. `remarks` are notes for the author, not faults. `key` is the key of the question to which a fault belongs:
    `answer`, or one of `verify` if that cannot be carried out. `accepted` is the author's reason to publish a key that
    simulation cannot tell. `cost_ms` is informative only.
    """

    verdict: Verdict
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
    regime: Mapping[str, Any] = field(default_factory=dict)
    accepted: str | None = None

    @property
    def ok(self) -> bool:
        """Whether the key is certified."""
        return self.verdict == "certified"

    @property
    def is_publishable(self) -> bool:
        """Whether the key is certified, or cannot be told and is accepted in writing."""
        return self.ok or (self.verdict == "cannot tell" and self.accepted is not None)

    def with_remark(self, remark: str) -> "Certificate":
        """Returns the certificate with one more remark."""
        return replace(self, remarks=(*self.remarks, remark))

    def to_json(self) -> dict[str, Any]:
        """Plain JSON."""
        return {
            "ok": self.ok,
            "verdict": self.verdict,
            "why": self.why,
            "method": self.method,
            "answer": self.answer,
            "expected": self.expected,
            "measured": dict(self.measured),
            "regime": dict(self.regime),
            "remarks": list(self.remarks),
            "uncertainty": self.uncertainty,
            "tolerance": self.tolerance,
            "accepted": self.accepted,
            "cost_ms": round(self.cost_ms, 3),
        }


def refuse(
    method: str, expected: int | float, why: str, key: str = "verify", *, measured: Mapping[str, Any] | None = None,
    failed: str | None = None,
) -> Certificate:  # fmt: skip
    """Returns a certificate for a key of which simulation cannot tell; `failed` names the condition of the runs."""
    regime = {} if failed is None else {"failed": failed}
    why = " ".join(why.split())
    return Certificate("cannot tell", why, method, None, expected, measured or {}, key=key, regime=regime)


def certify_number(
    method: str, key: NumberKey, derived: float, uncertainty: float, measured: Mapping[str, Any], *, cure: str = ""
) -> Certificate:
    """Certify a number: the derived value is within the tolerance, and its uncertainty below a fifth of it.

    Refutes what is outside by CERTAINLY times the uncertainty. `cure` says why the uncertainty may be large.
    """
    expected, tolerance = key.answer, key.tolerance
    off = abs(derived - expected)
    why = f"derived {derived:.9g} with an uncertainty of {uncertainty:.2g}"
    verdict: Verdict = "cannot tell"
    if off - CERTAINLY * uncertainty > tolerance:
        verdict, why = "refuted", f"{why}, but the key says {expected:g} within {tolerance:g}"
    elif not uncertainty <= UNCERTAINTY_SHARE * tolerance:
        why = (
            f"{why}, more than a fifth of the tolerance {tolerance:g}: the key cannot be decided{cure and f': {cure}'}"
        )
    elif off + uncertainty <= tolerance:
        verdict, why = "certified", f"{why}; the key {expected:g} is within {tolerance:g}"
    else:
        why = f"{why}: the key {expected:g} lies at the edge of its tolerance {tolerance:g}, write the derived value"
    remarks = []
    if verdict != "certified":
        why += f"; measured: {format_measurements(measured)}"
    elif off > tolerance / 2:
        remarks.append(f"The key differs by {off:.3g} from the derived value, {derived:.9g}.")
    return Certificate(verdict, why, method, derived, expected, measured, tuple(remarks), uncertainty, tolerance)


def certify_choice(
    method: str, right: list[int], expected: int, options: tuple[str, ...], measured: Mapping[str, Any]
) -> Certificate:
    """Certify an option: exactly one is right, and it is the key."""
    answer = right[0] if len(right) == 1 else None
    if answer is None:
        names = ", ".join(repr(options[i]) for i in right) or "no option"
        why = f"{names} came out right, not exactly one"
    else:
        agreement = "as the key says" if answer == expected else f"but the key says {options[expected]!r}"
        why = f"{options[answer]!r} came out right, {agreement}"
    if answer != expected:
        why += f"; measured: {format_measurements(measured)}"
    return Certificate("certified" if answer == expected else "refuted", why, method, answer, expected, measured)


def format_measurements(measured: Mapping[str, Any]) -> str:
    """Returns the measurements as one line of text; numbers with six digits, as many as tell how they converge."""
    return "; ".join(f"{name}: {write_value(value)}" for name, value in measured.items())


def write_value(value: Any) -> str:
    """Returns a measured value as text."""
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(write_value, value))}]"
    return str(value)
