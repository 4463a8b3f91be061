"""How many of its goals the model of a verdict meets: its goals have units of their own, and share no other axis."""

from collections.abc import Iterator, Mapping
from math import inf
from typing import Any

from grader.domain.axes import ClassAxis, Placed, list_findings, place_number
from grader.exercises.kinds.model.parameters import ModelParameters
from grader.exercises.parameters import name_cases


def place_goals(parameters: ModelParameters, verdict: Mapping[str, Any]) -> Iterator[Placed]:
    """Yields one axis, of all cases: whether a goal is met is known of hidden cases too."""
    names, goals = name_cases(parameters.cases), sum(len(case.goals) for case in parameters.cases)
    cases = {*names, *names.values()}  # verdicts of older versions have the ids of hidden cases
    ids = {f"{name}.{index + 1}" for name in cases for index in range(goals)}
    judged = {id_: finding for id_, finding in list_findings(verdict) if id_ in ids | cases}
    if judged:
        met = sum(finding.get("passed") is True for id_, finding in judged.items() if id_ in ids)
        axis = ClassAxis("goals", "Goals met", "goals", (goals, inf), line=f"all {goals}", is_whole=True)
        yield axis, place_number(met, met == goals)
