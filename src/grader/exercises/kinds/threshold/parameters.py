"""The parameters of a `threshold` exercise, and the cells that they define."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from typing import Literal, Self

import numpy as np
from pydantic import Field, model_validator

from grader.exercises.kind import DrawnCase
from grader.exercises.parameters import Case, ExerciseParameters, WrongParameter
from grader.numerics.integrators import BY_NAME, Integrator
from grader.numerics.scene import Scene

IntegratorName = Literal["Euler", "RK4", "implicit", "implicitfast", "discrete"]


class ThresholdParameters(ExerciseParameters):
    """Search and width in s, horizon in s; `start` names joints of one degree of freedom [rad or m]."""

    model: str
    start: dict[str, float] = Field(min_length=1)
    horizon_s: float = Field(default=3.0, gt=0, le=60)
    search_s: tuple[float, float] = (0.001, 0.050)
    width_s: float = Field(default=0.0005, gt=0)
    integrators: tuple[IntegratorName, ...] = Field(min_length=1)

    @model_validator(mode="after")
    def _check_search(self) -> Self:
        if not 1e-5 <= self.search_s[0] < self.search_s[1] <= 1:
            raise ValueError("search_s must be [shortest, longest], between 0.00001 and 1 s")
        return self


@dataclass(frozen=True)
class Cell:
    """One model under one integrator. Both scenes begin at `start`, a joint's name with its position [rad or m].

    `scene_as_written` lacks the drawn numbers. A scene is compiled on its first use, once for all integrators.
    """

    case: str
    xml: str
    xml_as_written: str
    start: tuple[tuple[str, float], ...]
    integrator: Integrator

    @cached_property
    def scene(self) -> Scene:
        """The scene of the case. Raises WrongParameter, ValueError."""
        return pose(self.xml, self.start)

    @cached_property
    def scene_as_written(self) -> Scene:
        """The scene of the model as its author wrote it. Raises as `scene`."""
        return pose(self.xml_as_written, self.start)


@lru_cache(maxsize=64)
def pose(xml: str, start: tuple[tuple[str, float], ...]) -> Scene:
    """Returns the scene of a model with the joints of `start` moved. Raises WrongParameter, ValueError."""
    scene = Scene.from_xml(xml)
    qpos = np.array(scene.start.qpos)
    for joint, value in start:
        try:
            where = scene.qpos_of(joint)
        except KeyError as error:
            raise WrongParameter(f"start.{joint}", str(error.args[0])) from error
        if where.stop - where.start != 1:
            raise WrongParameter(f"start.{joint}", f"joint {joint!r} has more than one coordinate")
        qpos[where] = value
    return scene.at(qpos=qpos)


def cells(parameters: ThresholdParameters, drawn: DrawnCase[Case]) -> Sequence[Cell]:
    """Returns a case's cells, one for each integrator."""
    start = tuple(parameters.start.items())
    made = partial(Cell, drawn.case.id, drawn.xml, drawn.xml_as_written, start)
    return [made(BY_NAME[name]) for name in parameters.integrators]
