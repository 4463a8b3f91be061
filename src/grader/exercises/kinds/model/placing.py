"""How many of its goals the model of a verdict meets: its goals have units of their own, and share no other axis."""

from collections.abc import Iterator, Mapping
from math import inf
from typing import Any

from grader.domain.axes import ClassAxis, Placed, list_findings, place_number
from grader.exercises.kinds.model.parameters import ModelParameters


def place_goals(parameters: ModelParameters, verdict: Mapping[str, Any]) -> Iterator[Placed]:
    """Yields one axis, of all cases: whether a goal is met is known of hidden cases too."""
    ids = {f"{case.id}.{index + 1}" for case in parameters.cases for index in range(len(case.goals))}
    cases = {case.id for case in parameters.cases}
    judged = {id_: finding for id_, finding in list_findings(verdict) if id_ in ids | cases}
    if judged:
        met = sum(finding.get("passed") is True for id_, finding in judged.items() if id_ in ids)
        axis = ClassAxis(
            "goals", "Goals met", "goals", (len(ids), inf), line=f"all {len(ids)}",
            is_whole=True
        )  # fmt: skip
        yield axis, place_number(met, met == len(ids))
