"""What a program runs on: one model and its data, the lab's own values, and a budget that ends every loop."""

import inspect
from collections.abc import Callable
from operator import attrgetter
from typing import Any, NoReturn

import mujoco

from grader.expressions.values import UNDEFINED, Trouble, Value, Vector

TICKS_PER_EVALUATION = 100_000
TICKS_PER_RUN = 3_000_000


class Machine:
    """The state that programs read and change: a model, its data, and `ctx`.

    A tick of the budget is one turn of a loop or one call of a function; long texts and arrays cost more. `budget`
    holds the ticks used so far and the number at which the evaluation in progress fails.
    """

    __slots__ = ("bound", "budget", "ctx", "data", "model", "vectors")

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        self.model = model
        self.data = data
        self.ctx: dict[str, Value] = {}
        self.budget = [0, TICKS_PER_EVALUATION]
        self.vectors: dict[str, Vector] = {}
        self.bound: dict[object, Any] = {}

    def tick(self, count: int = 1) -> bool:
        """Use up part of the budget; always true. Raises Trouble where none is left."""
        self.budget[0] += count
        if self.budget[0] > self.budget[1]:
            exhausted()
        return True

    def vector(self, path: str, writable: bool = True) -> Vector:
        """The field at an allowed path, such as `data.qpos`. MuJoCo keeps it in place while the data lives."""
        found = self.vectors.get(path)
        if found is None:
            array: Any = attrgetter(path)(self)
            found = self.vectors[path] = Vector(array, path, writable)
        return found


def exhausted() -> NoReturn:
    """Raise the error of a budget that is used up."""
    raise Trouble("it takes too many steps: does a loop never end?")


def lenient(function: Callable[..., Value]) -> Callable[..., Value]:
    """The function as JavaScript calls it: missing arguments are undefined, further ones are ignored."""
    code = function.__code__
    if code.co_flags & inspect.CO_VARARGS:
        return function
    needed = code.co_argcount - len(function.__defaults__ or ())
    return lambda *args: function(*args[: code.co_argcount], *[UNDEFINED] * (needed - len(args)))
