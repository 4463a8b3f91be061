"""One call of a student's function with its outcome and trace, as the recognisers of mistakes see it."""

from collections.abc import Callable
from dataclasses import dataclass

import mujoco

from grader.exercises.kinds.values.judging.driver import Rows
from grader.exercises.kinds.values.judging.judge import CallComparison, fits
from grader.exercises.kinds.values.judging.problem import Call
from grader.exercises.kinds.values.parameters import Problem, Result
from grader.exercises.programs import LINES_MAX, Program, limit_lines
from grader.exercises.trace import NO_TRACE, Trace

GUESS_LINES_MAX = 100_000
"""Lines that the reference may run for inputs that its author has not foreseen, with which its loops may not end."""


@dataclass(frozen=True, eq=False)
class StudentCall:
    """One call of the function, with its outcome."""

    problem: Problem
    comparison: CallComparison
    trace: Trace = NO_TRACE
    hidden: bool = False

    @property
    def pairs(self) -> list[tuple[Result, Rows, Rows]]:
        """Result, got and expected."""
        got, expected = self.comparison.answer.values or (), self.comparison.expected or ()
        return list(zip(self.problem.function.results, got, expected, strict=True))

    @property
    def wrong_pairs(self) -> list[tuple[Result, Rows, Rows]]:
        """The results that are not right."""
        return [(result, got, right) for result, got, right in self.pairs if not fits(result, got, right)]


def is_given_by(
    student_call: StudentCall,
    call: Call | None = None,
    program: Program | None = None,
    change: Callable[[mujoco.MjModel], None] | None = None,
    times: int = 1,
) -> bool:
    """Whether the reference (or another program) with these changes gives the student's results."""
    problem, values = student_call.problem, student_call.comparison.answer.values
    if program is not None and not callable(program.get(problem.name)):
        return False
    lines_max = LINES_MAX if call is None and change is None else GUESS_LINES_MAX
    asked = call or student_call.comparison.call
    try:
        results = limit_lines(lambda: problem.compute_results(asked, program, change, times), lines_max)
    except Exception:  # the author's program, outside the range that it was written for
        return False
    if isinstance(results, str) or values is None:
        return False
    return all(
        fits(result, got, row) for result, got, row in zip(problem.function.results, values, results, strict=True)
    )
