"""Bench: what a run of a lab computes with, and the limits that no run may pass."""

import copy
import time
from collections.abc import Callable
from dataclasses import dataclass

import mujoco

from grader.errors import LabError, LabRefused
from grader.numerics.scene import Scene
from grader.numerics.stepping import MujocoWarning, take_warnings

CHUNK = 1000
"""Steps in one call into C, between which the time of a run is looked at."""


@dataclass(frozen=True)
class Limits:
    """What one run may use: steps of MuJoCo, CPU time [s], and bytes of its answer as JSON, before compression."""

    steps: int = 200_000
    cpu_s: float = 20.0
    answer_bytes: int = 4 << 20


class Bench:
    """The models of the content folder, and MuJoCo's steps, which are counted in `steps`. It serves one run, in the
    thread that made it, and ends it at its limits; a kind that computes long without steps calls `check_time`."""

    def __init__(self, model_xml: Callable[[str], str], limits: Limits) -> None:
        self.read_model = model_xml
        self.limits = limits
        self.steps = 0
        self._began_s = time.thread_time()

    def load(self, name: str) -> mujoco.MjModel:
        """Returns a model of its own, to be changed at will, of the content folder's `models/NAME.xml`. Raises
        NotFound."""
        return copy.copy(Scene.from_xml(self.read_model(name)).model)

    def step(self, model: mujoco.MjModel, data: mujoco.MjData, count: int = 1) -> tuple[MujocoWarning, ...]:
        """Steps `count` times, and returns what MuJoCo warned of. After a warning that begins with BAD it has reset
        the state: what follows is another run. Raises LabRefused where the run takes too many steps or too long,
        LabError where MuJoCo gives up."""
        self.count(count)
        warnings: list[MujocoWarning] = []
        for done in range(0, count, CHUNK):
            try:
                mujoco.mj_step(model, data, min(CHUNK, count - done))
            except mujoco.FatalError as error:
                raise LabError("lab", f"MuJoCo: {error}") from error
            warnings += take_warnings(data.warning.number, float(data.time))
            self.check_time()
        return tuple(warnings)

    def count(self, steps: int) -> None:
        """Counts steps that are taken otherwise. Raises LabRefused where they are too many for one run."""
        self.steps += steps
        if self.steps > self.limits.steps:
            raise LabRefused(f"This run takes more than {self.limits.steps} steps: ask for less in one run.")

    def check_time(self) -> None:
        """Raises LabRefused where the run has used its CPU time."""
        if time.thread_time() - self._began_s > self.limits.cpu_s:
            raise LabRefused(f"This run takes more than {self.limits.cpu_s:g} s of computing: ask for less in one run.")
