"""One call of a student's function with its outcome and trace, as the recognisers of mistakes see it."""

from collections.abc import Callable
from dataclasses import dataclass

import mujoco

from grader.exercises.kinds.values.driver import Rows
from grader.exercises.kinds.values.judge import Comparison, fits
from grader.exercises.kinds.values.parameters import Call, Problem, Program, Result
from grader.exercises.trace import NO_TRACE, Trace


@dataclass(frozen=True, eq=False)
class Asked:
    """One call of the function, with its outcome."""

    problem: Problem
    compared: Comparison
    trace: Trace = NO_TRACE
    hidden: bool = False

    @property
    def pairs(self) -> list[tuple[Result, Rows, Rows]]:
        """Result, got and expected."""
        got, expected = self.compared.answer.values or (), self.compared.expected or ()
        return list(zip(self.problem.function.results, got, expected, strict=True))

    @property
    def wrong(self) -> list[tuple[Result, Rows, Rows]]:
        """The results that are not right."""
        return [(result, got, right) for result, got, right in self.pairs if not fits(result, got, right)]


def gives(
    asked: Asked,
    call: Call | None = None,
    program: Program | None = None,
    change: Callable[[mujoco.MjModel], None] | None = None,
    times: int = 1,
) -> bool:
    """Whether the reference (or another program) with these changes gives the student's results."""
    problem, values = asked.problem, asked.compared.answer.values
    if program is not None and not callable(program.get(problem.name)):
        return False
    try:
        found = problem.answer(call or asked.compared.call, program, change, times)
    except Exception:  # the author's program, outside the range that it was written for
        return False
    if isinstance(found, str) or values is None:
        return False
    return all(fits(result, got, row) for result, got, row in zip(problem.function.results, values, found, strict=True))
