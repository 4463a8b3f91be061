"""How far the steps of a verdict are from MuJoCo's, beside their tolerance, and of which order they are."""

from collections.abc import Iterator, Mapping
from typing import Any

from grader.domain.axes import ClassAxis, Placed, list_findings, place_number, read_number, read_passed, read_title
from grader.exercises.kinds.rk4.judging.judge import ORDER as FOURTH
from grader.exercises.kinds.rk4.parameters import Rk4Parameters

DISTANCE = "distance from MuJoCo's RK4"
OTHER_METHODS = "Beyond the tolerance is right what is as near to the exact motion as a method of fourth order."
NOT_FINITE = "did not stay finite"


def place_steps(parameters: Rk4Parameters, order_id: str, verdict: Mapping[str, Any]) -> Iterator[Placed]:
    """Yields an axis for each visible case with its largest distance, then that of the observed order, whose finding
    has the id `order_id`."""
    findings = dict(list_findings(verdict))
    for case in parameters.cases:
        finding = findings.get(case.id, {})
        measured = finding.get("measured")
        if isinstance(measured, dict) and measured:  # that of a hidden case is kept nowhere
            sizes = [read_number(value) for value in measured.values()]
            known = [size for size in sizes if size is not None]
            size = max(known) if len(known) == len(sizes) else None
            axis = ClassAxis(
                case.id, read_title(finding, case.id), "", (0.0, case.tolerance), measure=DISTANCE, line="tolerance",
                none=NOT_FINITE, is_log=True, note="" if parameters.accept == "mujoco" else OTHER_METHODS
            )  # fmt: skip
            yield axis, place_number(size, read_passed(finding))
    finding = findings.get(order_id, {})
    slope = read_number(finding.get("measured"))
    if slope is not None and parameters.order is not None:
        around = parameters.order.tolerance
        axis = ClassAxis(order_id, read_title(finding, order_id), "", (FOURTH - around, FOURTH + around))
        yield axis, place_number(slope, read_passed(finding))
