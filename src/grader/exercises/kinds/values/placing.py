"""How far the worst result of each case is off, beside its tolerance: from what verdicts keep."""

from collections.abc import Iterator, Mapping
from typing import Any

from grader.domain.axes import (
    ClassAxis,
    Placed,
    list_findings,
    list_parts,
    place_number,
    read_number,
    read_numbers,
    read_passed,
    read_title,
)
from grader.exercises.kinds.values.parameters import Function, Result, ValuesCase, ValuesParameters

DEVIATION = "largest deviation"
RESIDUAL = "largest residual"
TOLERANCES = "tolerances"


def place_results(parameters: ValuesParameters, verdict: Mapping[str, Any]) -> Iterator[Placed]:
    """Yields an axis for each visible case in tolerances, since results of several units, each with a tolerance of its
    own, have one axis. Of a long result the table keeps the beginning."""
    rows, residuals = list_parts(verdict, "values"), list_parts(verdict, "residuals")
    findings = dict(list_findings(verdict))
    for case in parameters.cases:
        function = find_function(parameters, case)
        results = {result.name: result for result in function.results}
        sizes = [
            measure_deviation(results[str(row["result"])], row)
            for row in rows
            if row["case"] == case.id and str(row.get("result")) in results
        ]
        if function.residual is not None:
            left = [read_number(residual.get("size")) for residual in residuals if residual["case"] == case.id]
            sizes = [None if value is None else value / function.residual.atol for value in left]
        known = [size for size in sizes if size is not None]
        if known:
            finding = findings.get(case.id, {})
            axis = ClassAxis(
                case.id, read_title(finding, case.id), TOLERANCES, (0.0, 1.0),
                measure=DEVIATION if function.residual is None else RESIDUAL, line="tolerance", is_log=True
            )  # fmt: skip
            yield axis, place_number(max(known), read_passed(finding))


def find_function(parameters: ValuesParameters, case: ValuesCase) -> Function:
    """Returns the function that a case calls: the first without a choice. One without a name has the question's."""
    named = {function.name: function for function in parameters.functions}
    first = parameters.functions[0]
    return first if case.function is None else named.get(case.function) or named.get(None) or first


def measure_deviation(result: Result, row: Mapping[str, Any]) -> float | None:
    """Returns by how many tolerances a result is off; None where it has another shape, or a residual decides."""
    got, right = read_numbers(row.get("computed")), read_numbers(row.get("expected"))
    if got is None or right is None or len(got) != len(right):
        return None
    allowed = result.atol + result.rtol * max(map(abs, right))
    return max(abs(value - other) for value, other in zip(got, right, strict=True)) / allowed if allowed else None
