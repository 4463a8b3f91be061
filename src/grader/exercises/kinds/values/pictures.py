"""The evidence of visible calls: a table of computed and expected results."""

from collections.abc import Sequence
from typing import Any

from grader.exercises.kind import Judged
from grader.exercises.kinds.values.judge import Outcome, shortened
from grader.exercises.kinds.values.parameters import Problem

ROWS_MAX = 40


def evidence_of(visible: Sequence[Judged[Problem, Outcome]]) -> dict[str, Any]:
    """Returns `values`: one row for each result of a call that gave results; `expected` is None for a residual."""
    rows = [
        {
            "case": one.trial.id,
            "call": index + 1,
            "arguments": list(held.call.arguments),
            "result": result.name,
            "unit": result.unit,
            "computed": shortened(held.answer.values[position]),
            "expected": None if held.expected is None else shortened(held.expected[position]),
        }
        for one in visible
        for index, held in enumerate(one.judgement.outcome)
        if held.answer.values is not None
        for position, result in enumerate(one.trial.problem.function.results)
    ]
    return {"values": rows[:ROWS_MAX]}
