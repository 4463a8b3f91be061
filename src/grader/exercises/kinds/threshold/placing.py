"""Where the brackets of a verdict lie beside the limits that they have to hold."""

from collections.abc import Iterator, Mapping
from math import nan
from typing import Any

from grader.domain.axes import ClassAxis, Placed, Position, list_findings, list_parts, read_number, read_title

MS = "ms"
WITHOUT_DAMPING = "the limit without damping"
NO_LIMIT = Position(nan, nan)


def place_brackets(verdict: Mapping[str, Any]) -> Iterator[Placed]:
    """Yields an axis for each visible trial that returned, with what was claimed there."""
    limits = {part["case"]: part for part in list_parts(verdict, "limits")}
    findings = dict(list_findings(verdict))
    for claim in list_parts(verdict, "claims"):
        case, limit = claim["case"], limits.get(claim["case"], {})
        low, high, spring = (read_number(limit.get(name)) for name in ("linear_ms", "within_ms", "spring_ms"))
        right = None if low is None or high is None else (low, high)
        marks = () if right is None or spring is None else ((WITHOUT_DAMPING, spring),)
        title = read_title(findings.get(case, {}), case)
        yield ClassAxis(case, title, MS, right, is_limit=True, marks=marks), read_bracket(claim)


def read_bracket(claim: Mapping[str, Any]) -> Position | None:
    """Returns the bracket of a claim in the evidence; None where nothing was claimed."""
    ends = claim.get("claim_ms")
    numbers = [read_number(end) for end in ends] if isinstance(ends, list) else []
    if len(numbers) == 2 and numbers[0] is not None and numbers[1] is not None:
        return Position(numbers[0], numbers[1])
    return NO_LIMIT if claim.get("said_none") else None
