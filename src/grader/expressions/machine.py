"""What a program runs on: one model and its data, the lab's own values, and a budget that ends every loop."""

import inspect
from collections.abc import Callable
from functools import wraps
from typing import NoReturn

import mujoco

from grader.expressions.values import UNDEFINED, RunError, Value, Vector

TICKS_PER_EVALUATION = 100_000
TICKS_PER_RUN = 3_000_000


class Machine:
    """The state that programs read and change: a model, its data, and `ctx`. A tick of the budget is one turn of a loop
    or one call of a function; long texts and arrays cost more. `budget` holds the ticks used so far and the number at
    which the evaluation in progress fails."""

    __slots__ = ("budget", "ctx", "data", "model", "vectors")

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        self.model = model
        self.data = data
        self.ctx: dict[str, Value] = {}
        self.budget = [0, TICKS_PER_EVALUATION]
        self.vectors: dict[str, Vector] = {}

    def tick(self, count: int = 1) -> bool:
        """Use up part of the budget; always true. Raises RunError where none is left."""
        self.budget[0] += count
        if self.budget[0] > self.budget[1]:
            raise_exhausted()
        return True


def raise_exhausted() -> NoReturn:
    """Raise the error of a budget that is used up."""
    raise RunError("it takes too many steps: does a loop never end?")


def count_arguments(function: Callable[..., Value]) -> int | None:
    """How many arguments a function takes; None where it takes any number."""
    kinds = [parameter.kind for parameter in inspect.signature(function).parameters.values()]
    return (
        None if inspect.Parameter.VAR_POSITIONAL in kinds else len(kinds) - kinds.count(inspect.Parameter.KEYWORD_ONLY)
    )


def make_lenient(function: Callable[..., Value]) -> Callable[..., Value]:
    """Returns the function as JavaScript calls it: missing arguments are undefined, further ones are ignored."""
    count, defaults = count_arguments(function), function.__defaults__ or ()
    if count is None:
        return function
    needed = count - len(defaults)
    return wraps(function)(lambda *args: function(*args[:count], *[UNDEFINED] * (needed - len(args))))


def find_callback(function: Callable[..., Value]) -> tuple[int, bool] | None:
    """Which of an author's arguments is itself a function, if one is, and whether it may not be missing. It is the
    parameter `f`; the first parameter, the machine or the value of a method, is no argument of an author."""
    _, *taken = inspect.signature(function).parameters.values()
    return next(((i, p.default is p.empty) for i, p in enumerate(taken) if p.name == "f"), None)
