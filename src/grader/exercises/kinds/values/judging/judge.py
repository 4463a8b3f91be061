"""Judges results: compares them with those of the author's program, or computes a residual that must vanish."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from grader.exercises.judgement import Judgement, Results, tell_to_convert
from grader.exercises.kinds.values.judging.driver import Rows, to_numbers
from grader.exercises.kinds.values.judging.problem import Call, Problem, RanTooLong, Residual, Result

ELEMENTS_SHOWN = 12

UNSATISFIED = "Your results do not satisfy the exercise's own equation"
CHECK = "Put the results of a call into that equation yourself, and look at which term is off."


@dataclass(frozen=True, eq=False)
class Answer:
    """The answer of one call: the `values` of its results, or None and the `text` of what was returned instead."""

    values: tuple[Rows, ...] | None
    text: str = ""
    printed: bool = False


@dataclass(frozen=True, eq=False)
class CallComparison:
    """One call with its answer. `expected` is None where a residual decides; `why` is empty if the answer is right.
    `residual` is the size of the residual, None where none was computed."""

    call: Call
    answer: Answer
    expected: tuple[Rows, ...] | None
    why: str
    detail: str = ""
    residual: float | None = None


Comparisons = tuple[CallComparison, ...]


def read_answer(problem: Problem, results: Results, index: int) -> Answer:
    """Returns the answer of one call; arrays that the driver never sends count as no result."""
    arrays = [results.get(f"r{index}_{position}") for position in range(len(problem.function.results))]
    values = [None if value is None or value.dtype != np.float64 else to_numbers(value) for value in arrays]
    if not any(value is None for value in values):
        return Answer(tuple(value for value in values if value is not None))
    text = results.get(f"other{index}", np.empty(0, np.uint8))
    printed: Any = results.get(f"printed{index}", np.zeros(1, np.uint8))
    return Answer(None, text.tobytes()[:200].decode(errors="replace"), bool(np.any(printed == 1)))


def compute_tolerance(result: Result, expected: Rows) -> float:
    """Returns the largest allowed difference, in the result's unit."""
    return result.atol + result.rtol * float(np.max(np.abs(expected), initial=0.0))


def fits(result: Result, got: Rows, expected: Rows) -> bool:
    """Whether shape and numbers agree."""
    return got.shape == expected.shape and find_largest(got - expected) <= compute_tolerance(result, expected)


def find_largest(values: Rows) -> float:
    """Returns the largest size of any element."""
    return float(np.max(np.abs(values), initial=0.0))


def judge_calls(problem: Problem, results: Results) -> Judgement[Comparisons]:
    """Judges every call of a trial; all must be right."""
    outcome = tuple(compare(problem, call, read_answer(problem, results, i)) for i, call in enumerate(problem.calls))
    wrong = next(((index, compared) for index, compared in enumerate(outcome) if compared.why), None)
    shown = outcome[wrong[0] if wrong else 0]
    names = [result.name for result in problem.function.results]
    return Judgement(
        passed=wrong is None,
        message=wrong[1].why if wrong else describe_agreement(problem),
        outcome=outcome,
        detail=f"In call {wrong[0] + 1}: {wrong[1].detail}" if wrong and wrong[1].detail else "",
        measured=shown.answer.text if shown.answer.values is None else list_results(names, shown.answer.values),
        expected=None if shown.expected is None else list_results(names, shown.expected),
    )


def describe_agreement(problem: Problem) -> str:
    """Returns the sentence of a trial that passed."""
    residual = problem.function.residual
    if residual is not None:
        return f"Every residual is at most {residual.atol:g}{prefix_unit(residual.unit)}."
    return "Every result agrees with the reference within its tolerance."


def list_results(names: list[str], values: tuple[Rows, ...]) -> dict[str, Any]:
    """Returns results by name as plain JSON, long ones cut off."""
    return {name: shorten(value) for name, value in zip(names, values, strict=True)}


def shorten(values: Rows) -> Any:
    """Returns a number, or a list of at most ELEMENTS_SHOWN of them, to seven figures."""
    figures = [float(f"{value:.7g}") for value in values.ravel()[:ELEMENTS_SHOWN].tolist()]
    return figures[0] if values.ndim == 0 else figures


def prefix_unit(text: str) -> str:
    """Returns a unit with the space that separates it from a number; empty for no unit."""
    return f" {text}" if text else ""


def compare(problem: Problem, call: Call, answer: Answer) -> CallComparison:
    """Compares the answer of one call with the author's program."""
    if answer.values is None:
        what = " and ".join(filter(None, (describe_returned(problem), describe_fields(problem))))
        why = f"The function must {what} as finite numbers{tell_to_convert(answer.text)}."
        return CallComparison(call, answer, problem.compute_expected(call), why, f"it gave {answer.text}.")
    expected = problem.compute_expected(call)
    shapes = problem.list_shapes(call) if expected is None else [right.shape for right in expected]
    for result, got, shape in zip(problem.function.results, answer.values, shapes, strict=True):
        if got.shape != shape:  # before anything is computed: arrays of other shapes broadcast to huge or empty ones
            detail = f"{result.name} has the shape {got.shape}, not {shape}."
            return CallComparison(call, answer, expected, f"{result.name} has the wrong shape.", detail)
    if expected is None:
        return compare_residual(problem, call, answer, answer.values)
    for result, got, right in zip(problem.function.results, answer.values, expected, strict=True):
        if not fits(result, got, right):
            off = f"{result.name} is off by {find_largest(got - right):.3g}{prefix_unit(result.unit)}"
            detail = f"{off}; {compute_tolerance(result, right):.2g}{prefix_unit(result.unit)} is allowed."
            return CallComparison(call, answer, expected, f"{result.name} is wrong.", detail)
    return CallComparison(call, answer, expected, "")


def describe_returned(problem: Problem) -> str:
    """Returns the results that the function must return, in words."""
    names = [result.name for result in problem.function.results if result.field is None]
    return f"return {', '.join(names)}" if names else ""


def describe_fields(problem: Problem) -> str:
    """Returns the fields of data in which the function must leave results, in words."""
    names = [f"data.{result.field}" for result in problem.function.results if result.field is not None]
    return f"leave {', '.join(names)}" if names else ""


def compare_residual(problem: Problem, call: Call, answer: Answer, values: tuple[Rows, ...]) -> CallComparison:
    """Judges by the author's residual. Results for which it cannot be computed are wrong."""
    residual = problem.function.residual
    assert residual is not None
    try:
        size = compute_residual(problem, call, values)
    except MemoryError:
        raise
    except Exception as error:  # the author's own function, over results that it does not foresee
        how = "does not end for them in time" if isinstance(error, RanTooLong) else "cannot be computed for them"
        why = f"{UNSATISFIED}: {name_remainder(residual)} {how}. Look for a result that can be no solution, such as 0."
        return CallComparison(call, answer, None, why, f"{type(error).__name__}: {error}.")
    if size <= residual.atol:
        return CallComparison(call, answer, None, "", residual=size)
    detail = f"it is {size:.3g}{prefix_unit(residual.unit)}; {residual.atol:g}{prefix_unit(residual.unit)} is allowed."
    why = f"{UNSATISFIED}: {name_remainder(residual)} should be 0 for them. {CHECK}"
    return CallComparison(call, answer, None, why, detail, size)


def name_remainder(residual: Residual) -> str:
    """Returns what must vanish, as the author calls it. The name of a function tells learners nothing."""
    return residual.title or "what remains when they are put into it"


def compute_residual(problem: Problem, call: Call, values: tuple[Rows, ...]) -> float:
    """Returns the largest element of the residual. Raises ValueError if it is not finite, and what the author does."""
    residual = problem.function.residual
    assert residual is not None
    rest = problem.compute_remainder(call, values)
    if rest is None or not rest.size:
        raise ValueError("it is not finite")
    return find_largest(rest)
