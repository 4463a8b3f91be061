"""Where the claims of a verdict lie beside what was measured: on the axis of their own quantity, or in tolerances where
every learner has other numbers."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from grader.domain.axes import (
    ClassAxis,
    Placed,
    Position,
    list_findings,
    place_number,
    read_numbers,
    read_passed,
    read_title,
)
from grader.exercises.kinds.claims.parameters import Claim, ClaimsParameters
from grader.exercises.parameters import list_ends

DEVIATION = "deviation"
TOLERANCES = "tolerances"


def place_claims(parameters: ClaimsParameters, verdict: Mapping[str, Any]) -> Iterator[Placed]:
    """Yields an axis for each claim of each visible case. A curve is placed by its deviation."""
    findings = dict(list_findings(verdict))
    for case in parameters.cases:
        is_drawn = len(list_ends(case)) > 1
        for claim in parameters.claims:
            id_ = case.id if len(parameters.claims) == 1 else f"{case.id}.{claim.name}"
            finding = findings.get(id_, {})
            claimed, right = read_numbers(finding.get("measured")), read_numbers(finding.get("expected"))
            if right is None:
                continue
            title, passed = read_title(finding, id_), read_passed(finding)
            if is_drawn or claim.form == "curve":
                axis = ClassAxis(
                    id_, title, TOLERANCES, (0.0, 1.0), measure=DEVIATION, line="tolerance", is_log=True
                )  # fmt: skip
                size = None if claimed is None else measure_deviation(claim, claimed, right)
                yield axis, None if size is None else place_number(size, passed)
            else:
                around = 0.0 if claim.form == "interval" else claim.allow(np.array(right))
                axis = ClassAxis(id_, title, claim.unit, (right[0] - around, right[0] + around), line=name_line(claim))
                yield axis, None if claimed is None else Position(claimed[0], claimed[-1], passed)


def name_line(claim: Claim) -> str:
    """Returns what the line of a claim is called."""
    return "measured" if claim.form == "interval" else ""


def measure_deviation(claim: Claim, claimed: list[float], right: list[float]) -> float | None:
    """Returns by how many tolerances a claim is off; None where it has another number of values."""
    if claim.form == "interval":
        claimed = [sum(claimed) / len(claimed)]
    if len(claimed) != len(right):
        return None
    off = np.array(claimed) - np.array(right)
    size = float(np.sqrt(np.mean(off**2))) if claim.norm == "rms" else float(np.abs(off).max())
    return size / claim.allow(np.array(right))
