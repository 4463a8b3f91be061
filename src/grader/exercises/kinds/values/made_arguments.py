"""Arguments that an author's program makes of the drawn numbers: reachable targets, noisy trajectories. The program is
called in the jail; what it returns is checked here."""

from typing import Any

import numpy as np

from grader.errors import NotFound
from grader.exercises.kind import DrawnCase
from grader.exercises.parameters import WrongInCase
from grader.exercises.running.program_calls import ProgramCall, call_program

ARGUMENTS_MAX = 20

NUMBERS_MAX = 10_000
"""Most numbers of all arguments of a call: they go to the jail as JSON."""


def make_arguments(drawn: DrawnCase[Any], path: str, function: str) -> tuple[Any, ...]:
    """Returns the arguments of a call as plain JSON: what an author's function makes of (model, numbers, rng). Raises
    WrongInCase where the function fails, or returns what no function of a learner's can be called with; JailFault."""
    try:
        text, seed = drawn.content.text_of(path), int(drawn.rng.integers(2**63))
        call = ProgramCall(path, text, function, drawn.xml, drawn.numbers, seed)
        return read_arguments(path, call_program(call, is_fixed=drawn.content.is_fixed), drawn.xml)
    except (ValueError, NotFound) as error:
        raise WrongInCase("arguments", str(error)) from error


def read_arguments(path: str, values: list[Any], xml: str) -> tuple[Any, ...]:
    """Returns arguments that a learner's function can be called with. Raises ValueError."""
    if len(values) > ARGUMENTS_MAX:
        raise ValueError(f"{path} makes {len(values)} arguments; at most {ARGUMENTS_MAX} are taken")
    arguments = tuple(read_argument(f"argument {index} of {path}", value, xml) for index, value in enumerate(values, 1))
    if (count := sum(np.size(argument) for argument in arguments)) > NUMBERS_MAX:
        raise ValueError(f"{path} makes {count} numbers; at most {NUMBERS_MAX} are taken")
    return arguments


def read_argument(name: str, value: Any, xml: str) -> Any:
    """Returns an argument as plain JSON: a number, a whole number, nested lists of numbers, "model" or "data". Raises
    ValueError for anything else."""
    if value in ("model", "data"):
        if not xml:
            raise ValueError(f"{name} is the {value}, and the case has no model: give it one")
        return value
    array = read_array(value)
    if array is None:
        raise ValueError(f'{name} must be a finite number, an array of them, "model" or "data", {say_why_not(value)}')
    if array.ndim == 0:
        return array.item()
    if not array.size:
        raise ValueError(f"{name} is an empty array")
    return np.asarray(array, dtype=np.float64).tolist()


def say_why_not(value: Any) -> str:
    """Returns what a value that is no argument is instead."""
    if isinstance(value, dict):
        return f"not {value.get('type')}"
    return "and has nan or inf" if holds_numbers(value) else f"not {type(value).__name__}"


def holds_numbers(value: Any) -> bool:
    """Whether a value is a number or an array of numbers, which need not be finite."""
    try:
        return np.asarray(value).dtype.kind in "iuf"
    except (ValueError, TypeError):
        return False


def read_array(value: Any) -> np.ndarray[Any, Any] | None:
    """Returns finite numbers as an array; None for anything else."""
    array = np.asarray(value) if holds_numbers(value) else None
    return array if array is not None and np.isfinite(array).all() else None
