"""Arguments that an author's program makes of the drawn numbers: reachable targets, noisy trajectories. What it returns
is checked, and kept by all that it depends on."""

from functools import lru_cache
from typing import Any

import numpy as np

from grader.exercises.kinds.values.judging.driver import compile_model
from grader.exercises.programs import limit_lines, run_program

ARGUMENTS_MAX = 20

NUMBERS_MAX = 10_000
"""Most numbers of all arguments of a call: they go to the jail as JSON."""

KEPT_MAX = 1024
"""Calls whose arguments are kept."""


@lru_cache(maxsize=KEPT_MAX)
def run_arguments(
    maker: tuple[str, str, str], xml: str, numbers: tuple[tuple[str, float], ...], seed: int
) -> tuple[Any, ...]:
    """Returns the arguments of a call as plain JSON: what an author's function makes of (model, numbers, rng). `maker`
    is the path of its program, its name, and the program's text. Raises ValueError where the function fails, or returns
    what no function of a learner's can be called with."""
    path, function, text = maker
    make = run_program(path, text).get(function)
    if not callable(make):
        raise ValueError(f"`arguments`: {path} defines no function {function}(model, numbers, rng)")
    try:
        model, rng = compile_model(xml), np.random.default_rng(seed)
        made = limit_lines(lambda: make(model, dict(numbers), rng))
    except Exception as error:  # an author's program may raise anything
        raise ValueError(f"`arguments`: {function} of {path} raises {type(error).__name__}: {error}") from error
    if not isinstance(made, list | tuple) or len(made) > ARGUMENTS_MAX:
        raise ValueError(f"`arguments`: {function} of {path} must return a list of at most {ARGUMENTS_MAX} arguments")
    arguments = tuple(read_argument(index, one, xml) for index, one in enumerate(made, 1))
    if (count := sum(np.size(one) for one in arguments)) > NUMBERS_MAX:
        raise ValueError(f"`arguments`: {function} of {path} makes {count} numbers; at most {NUMBERS_MAX} are taken")
    return arguments


def read_argument(index: int, value: Any, xml: str) -> Any:
    """Returns an argument as plain JSON: a number, a whole number, nested lists of numbers, "model" or "data". Raises
    ValueError for anything else."""
    if isinstance(value, str) and value in ("model", "data"):
        if not xml:
            raise ValueError(f"`arguments`: argument {index} is the {value}, and the case has no model")
        return value
    array = read_array(value)
    if array is None:
        what = f'a finite number, an array of them, "model" or "data", not {type(value).__name__}'
        raise ValueError(f"`arguments`: argument {index} must be {what}")
    if array.ndim == 0:
        return array.item()
    if not array.size:
        raise ValueError(f"`arguments`: argument {index} is an empty array")
    return np.asarray(array, dtype=np.float64).tolist()


def read_array(value: Any) -> np.ndarray[Any, Any] | None:
    """Returns finite numbers as an array; None for anything else."""
    try:
        array = np.asarray(value)
    except (ValueError, TypeError):
        return None
    return array if array.dtype.kind in "iuf" and np.isfinite(array).all() else None
