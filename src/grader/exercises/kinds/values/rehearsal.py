"""Rehearses the calls of a case with the author's program."""

from collections.abc import Sequence

import numpy as np

from grader.exercises.kinds.values.judging.driver import Rows
from grader.exercises.kinds.values.judging.problem import Call
from grader.exercises.kinds.values.parameters import Problem
from grader.exercises.programs import limit_lines

REHEARSED = (0.0, 1.0, 0.5, -1.0)
"""Numbers with which a residual is tried when content is loaded."""


def rehearse_call(problem: Problem, call: Call) -> None:
    """Raises ValueError if the author's program gives no results, or others than are declared."""
    shapes = problem.list_shapes(call)
    try:
        expected = limit_lines(lambda: problem.compute_expected(call))
    except Exception as error:  # an author's program may raise anything
        raise ValueError(f"the author's program fails: {type(error).__name__}: {error}") from error
    if expected is None:
        rehearse_residual(problem, call, [shape or () for shape in shapes])
        return
    for result, right, shape in zip(problem.function.results, expected, shapes, strict=True):
        if shape not in (None, right.shape):
            raise ValueError(f"{result.name} of the author's program has the shape {right.shape}, not {shape}")


def rehearse_residual(problem: Problem, call: Call, shapes: Sequence[tuple[int, ...]]) -> None:
    """Raises ValueError if the residual gives no numbers for results of the declared shapes, whatever they hold."""
    why = ""
    for number in REHEARSED:
        try:
            rest = problem.compute_remainder(call, tuple(np.full(shape, number) for shape in shapes))
        except Exception as error:  # it may raise for numbers that are far from right
            why = why or f"raises {type(error).__name__}: {error}"
            continue
        if rest is None or rest.size:
            return
        why = "gives no numbers, so that nothing is judged"
    named = ", ".join(f"{result.name} {shape}" for result, shape in zip(problem.function.results, shapes, strict=True))
    assert problem.function.residual is not None
    raise ValueError(f"{problem.function.residual.function} {why}, for results of the shapes {named}: declare `shape`")


TRIED = 8
"""Right answers of other draws that are tried as fixed answers: each costs a call of the residual in every draw."""


def count_lucky_answers(problems: Sequence[Problem]) -> list[int] | None:
    """Returns, for each call of a function with a residual, in how many draws the best fixed answer satisfies it: a
    constant, the author's own answer in another draw, or the mean of these. None where the author's program does not
    solve the function itself, so that no right answer is known. Calls that share a drawn model are one part."""
    first = problems[0]
    if first.function.residual is None or not callable(first.program.get(first.name)):
        return None
    counts = [count_lucky_calls(problems, index) for index in range(len(first.calls))]
    return counts if first.independent else [min(counts)]


def count_lucky_calls(problems: Sequence[Problem], index: int) -> int:
    """Returns in how many draws the best fixed answer satisfies the residual of one call."""
    solved = [problem.compute_results(problem.calls[index]) for problem in problems[:TRIED]]
    answers = [tuple(answer) for answer in solved if not isinstance(answer, str)]
    if len(answers) < len(solved):
        raise ValueError(f"{problems[0].name} of the author's program must give finite numbers")
    if all(len({each.shape for each in results}) == 1 for results in zip(*answers, strict=True)):
        answers.append(tuple(np.mean(results, axis=0) for results in zip(*answers, strict=True)))
    answers += [tuple(np.full_like(each, number) for each in answers[0]) for number in REHEARSED]
    return max(sum(is_satisfied(problem, problem.calls[index], answer) for problem in problems) for answer in answers)


def is_satisfied(problem: Problem, call: Call, answer: tuple[Rows, ...]) -> bool:
    """Whether an answer satisfies the residual of a call; one of another shape does not."""
    assert problem.function.residual is not None
    try:
        rest = problem.compute_remainder(call, answer)
    except Exception:  # it may raise for numbers that are far from right
        return False
    return rest is not None and bool(rest.size) and float(np.abs(rest).max()) <= problem.function.residual.atol
