"""A trial as plain JSON, for the learner's own machine, and its judgement there."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from grader.exercises.judgement import Judgement, Results
from grader.exercises.kinds.values.judging.driver import Rows
from grader.exercises.kinds.values.judging.judge import judge_calls
from grader.exercises.kinds.values.judging.problem import Call, Problem


@dataclass(frozen=True)
class DescribedResult:
    """One result, with its tolerance."""

    name: str
    field: str | None
    unit: str
    atol: float
    rtol: float


@dataclass(frozen=True)
class DescribedFunction:
    """A function that is judged by expected results."""

    results: tuple[DescribedResult, ...]
    residual: None = None


@dataclass(frozen=True, eq=False)
class DescribedProblem:
    """Calls with their expected results."""

    function: DescribedFunction
    calls: tuple[Call, ...]
    expected: tuple[tuple[Rows, ...], ...]

    def compute_expected(self, call: Call) -> tuple[Rows, ...]:
        """Returns the expected results."""
        return next(right for candidate, right in zip(self.calls, self.expected, strict=True) if candidate is call)

    def list_shapes(self, call: Call) -> list[tuple[int, ...] | None]:
        """Returns the shapes of the expected results."""
        return [right.shape for right in self.compute_expected(call)]

    def compute_remainder(self, call: Call, values: tuple[Rows, ...]) -> Rows | None:
        """Raises ValueError: a residual is the author's, and stays on the server."""
        raise ValueError("residuals are judged by the server alone")


def describe(problem: Problem) -> dict[str, Any]:
    """Returns the tolerances and the expected results of a trial."""
    names = ("name", "field", "unit", "atol", "rtol")
    expected = [problem.compute_expected(call) or () for call in problem.calls]
    return {
        "results": [{name: getattr(result, name) for name in names} for result in problem.function.results],
        "expected": [[right.tolist() for right in results] for results in expected],
    }


def judge(inputs: Mapping[str, Any], problem: Mapping[str, Any], results: Results) -> Judgement[Any]:
    """Compares the results of every call."""
    posed = DescribedProblem(
        DescribedFunction(tuple(DescribedResult(**result) for result in problem["results"])),
        tuple(Call(tuple(call["arguments"]), call["start"]) for call in inputs["calls"]),
        tuple(tuple(np.array(right, dtype=np.float64) for right in results) for results in problem["expected"]),
    )
    return judge_calls(posed, results)
