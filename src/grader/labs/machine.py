"""What a program runs on: one model and its data, the lab's own values, and a budget that ends every loop."""

from operator import attrgetter
from typing import Any

import mujoco

from grader.labs.values import UNDEFINED, Trouble, Value, Vector

TICKS_PER_EVALUATION = 100_000
TICKS_PER_RUN = 3_000_000


class Machine:
    """The state that expressions read and change. A tick is one turn of a loop or one call of a function."""

    __slots__ = ("ctx", "data", "limit", "model", "returned", "slots", "ticks", "value", "vectors")

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        self.model = model
        self.data = data
        self.ctx: dict[str, Value] = {}
        self.value: Value = UNDEFINED
        self.returned: Value = UNDEFINED
        self.slots: list[Value] = []
        self.ticks = 0
        self.limit = TICKS_PER_EVALUATION
        self.vectors: dict[tuple[str, ...], Vector] = {}

    def begin(self, slots: int) -> None:
        """Before each evaluation: fresh locals and a fresh budget, within what the whole run may use."""
        self.slots = [UNDEFINED] * slots
        self.limit = min(self.ticks + TICKS_PER_EVALUATION, TICKS_PER_RUN)

    def tick(self, count: int = 1) -> None:
        """Use up part of the budget."""
        self.ticks += count
        if self.ticks > self.limit:
            raise Trouble("it takes too many steps: does a loop never end?")

    def vector(self, path: tuple[str, ...], writable: bool) -> Vector:
        """The field at an allowed path, such as ("data", "qpos"). MuJoCo keeps them in place for a whole run."""
        found = self.vectors.get(path)
        if found is None:
            array: Any = attrgetter(".".join(path))(self)
            found = self.vectors[path] = Vector(array, ".".join(path), writable)
        return found
