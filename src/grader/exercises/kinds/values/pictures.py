"""The evidence of visible calls: a table of computed and expected results, and the residuals."""

from collections.abc import Sequence
from typing import Any

from grader.exercises.kind import JudgedTrial
from grader.exercises.kinds.values.judging.judge import Comparisons, shorten
from grader.exercises.kinds.values.parameters import Problem

ROWS_MAX = 40


def build_evidence(visible: Sequence[JudgedTrial[Problem, Comparisons]]) -> dict[str, Any]:
    """Returns `values`: one row for each result of a call that gave results; `expected` is None for a residual.
    `residuals` has the size of each residual that was computed."""
    rows = [
        {
            "case": trial.id,
            "call": index + 1,
            "arguments": list(compared.call.arguments),
            "result": result.name,
            "unit": result.unit,
            "computed": shorten(compared.answer.values[position]),
            "expected": None if compared.expected is None else shorten(compared.expected[position]),
        }
        for trial in visible
        for index, compared in enumerate(trial.judgement.outcome)
        if compared.answer.values is not None
        for position, result in enumerate(trial.problem.function.results)
    ]
    residuals = [
        {"case": trial.id, "call": index + 1, "size": float(f"{compared.residual:.4g}")}
        for trial in visible
        for index, compared in enumerate(trial.judgement.outcome)
        if compared.residual is not None
    ]
    return {"values": rows[:ROWS_MAX], **({"residuals": residuals[:ROWS_MAX]} if residuals else {})}
