"""Rehearses the calls of a case with the author's program."""

from collections.abc import Sequence

import numpy as np

from grader.exercises.kinds.values.judging.problem import Call
from grader.exercises.kinds.values.parameters import Problem

REHEARSED = (0.0, 1.0, 0.5, -1.0)
"""Numbers with which a residual is tried when content is loaded."""


def rehearse_call(problem: Problem, call: Call) -> None:
    """Raises ValueError if the author's program gives no results, or others than are declared."""
    shapes = problem.list_shapes(call)
    try:
        expected = problem.compute_expected(call)
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
    named = ", ".join(f"{one.name} {shape}" for one, shape in zip(problem.function.results, shapes, strict=True))
    assert problem.function.residual is not None
    raise ValueError(f"{problem.function.residual.function} {why}, for results of the shapes {named}: declare `shape`")
