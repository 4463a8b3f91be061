"""Rehearses the calls of a case with the author's program."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from grader.exercises.kinds.values.judging.driver import Rows
from grader.exercises.kinds.values.judging.problem import Call
from grader.exercises.kinds.values.parameters import Problem
from grader.exercises.programs import limit_lines, run_again

REHEARSED = (0.0, 1.0, 0.5, -1.0)
"""Numbers with which a residual is tried when content is loaded."""


LARGEST = 1e100
"""The largest number of a result: squares of it are finite."""

CURE = "let nothing but its arguments decide: draw with np.random.default_rng(a number), and keep nothing between calls"


def rehearse_call(problem: Problem, call: Call) -> None:
    """Raises ValueError if the author's program gives no results, others than are declared, or others each time."""
    shapes = problem.list_shapes(call)
    try:
        expected = limit_lines(lambda: problem.compute_expected(call))
    except Exception as error:  # an author's program may raise anything
        raise ValueError(f"the author's program fails: {type(error).__name__}: {error}") from error
    again = compute_again(problem, lambda problem: problem.compute_expected(call))
    if not all(are_equal(expected, other) for other in again):
        raise ValueError(f"{problem.name} of the author's program gives other results when it is called again: {CURE}")
    if expected is None:
        rehearse_residual(problem, call, [shape or () for shape in shapes])
        return
    for result, right, shape in zip(problem.function.results, expected, shapes, strict=True):
        if (largest := float(np.max(np.abs(right), initial=0.0))) > LARGEST:
            why = f"is as large as {largest:.3g}: at most {LARGEST:g} is compared. Choose another unit"
            raise ValueError(f"{result.name} of the author's program {why}")
        if shape not in (None, right.shape):
            raise ValueError(f"{result.name} of the author's program has the shape {right.shape}, not {shape}")
        if result.field is None and shape is None and right.shape == (1,):
            why = "is an array of one number, so that a plain number would be wrong"
            raise ValueError(f"{result.name} of the author's program {why}: return a number, or declare `shape`")


def compute_again(problem: Problem, compute: Callable[[Problem], tuple[Rows, ...] | None]) -> list[Any]:
    """Returns what is computed twice by the author's program run anew: of a program that was called before in this
    process, and of one that was not. Raises ValueError if it fails now."""
    fresh = replace(problem, program=run_again(problem.program, problem.text))
    try:
        return [limit_lines(lambda: compute(fresh)) for _ in range(2)]
    except Exception as error:  # an author's program may raise anything
        why = f"{type(error).__name__}: {error}"
        raise ValueError(f"the author's program fails when it is called again: {why}") from error


def are_equal(one: tuple[Rows, ...] | None, other: tuple[Rows, ...] | None) -> bool:
    """Whether results agree in every bit."""
    if one is None or other is None:
        return one is other
    return all(map(np.array_equal, one, other))


def rehearse_residual(problem: Problem, call: Call, shapes: Sequence[tuple[int, ...]]) -> None:
    """Raises ValueError if the residual gives no numbers for results of the declared shapes, whatever they hold."""
    why = ""
    for number in REHEARSED:
        results = tuple(np.full(shape, number) for shape in shapes)
        try:
            rest = problem.compute_remainder(call, results)
        except Exception as error:  # it may raise for numbers that are far from right
            why = why or f"raises {type(error).__name__}: {error}"
            continue
        if rest is None or rest.size:
            require_equal_residuals(problem, call, results, rest)
            return
        why = "gives no numbers, so that nothing is judged"
    named = ", ".join(f"{result.name} {shape}" for result, shape in zip(problem.function.results, shapes, strict=True))
    assert problem.function.residual is not None
    raise ValueError(f"{problem.function.residual.function} {why}, for results of the shapes {named}: declare `shape`")


def require_equal_residuals(problem: Problem, call: Call, results: tuple[Rows, ...], rest: Rows | None) -> None:
    """Raises ValueError if the residual of the same results is another one each time."""
    for other in compute_again(problem, lambda problem: pack(problem.compute_remainder(call, results))):
        if not are_equal(pack(rest), other):
            assert problem.function.residual is not None
            name = problem.function.residual.function
            raise ValueError(f"{name} of the author's program gives another residual when it is called again: {CURE}")


def pack(rest: Rows | None) -> tuple[Rows, ...] | None:
    """Returns a residual as results are kept."""
    return None if rest is None else (rest,)


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
