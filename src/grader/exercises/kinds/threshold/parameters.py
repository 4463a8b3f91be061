"""The parameters of a `threshold` exercise, and the cells that they define."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator, Field, ValidationInfo
from pydantic_core import PydanticCustomError

from grader.domain.numbers import Positive, Range, Real
from grader.exercises.kind import DrawnCase
from grader.exercises.parameters import Case, ExerciseParameters, WrongParameter
from grader.numerics.integrators import BY_NAME, Integrator
from grader.numerics.scene import Scene
from grader.numerics.stability.equilibrium import find_equilibrium

IntegratorName = Literal["Euler", "RK4", "implicit", "implicitfast", "discrete"]


STEPS_MAX = 1_000_000
"""Most steps of one run: 2 s of computing for the lesson's servo."""


def check_search(search_s: Range) -> Range:
    """Returns the range of timesteps [s] itself. Raises PydanticCustomError for one that cannot be searched."""
    if not 1e-5 <= search_s.low < search_s.high <= 1:
        raise PydanticCustomError("search", "must be [shortest, longest], two timesteps from 0.00001 to 1 s")
    return search_s


def check_horizon(horizon_s: float, info: ValidationInfo) -> float:
    """Returns the horizon [s] itself. Raises PydanticCustomError where a run has no step, or too many."""
    shortest, longest = info.data.get("search_s", (horizon_s, horizon_s))
    if not longest <= horizon_s <= STEPS_MAX * shortest:
        limits = {"least": f"{longest:g}", "most": f"{STEPS_MAX * shortest:g}", "steps": STEPS_MAX}
        why = "must be from {least} (one step at the longest timestep) to {most} ({steps} steps at the shortest)"
        raise PydanticCustomError("horizon", why, limits)
    return horizon_s


def check_width(width_s: float, info: ValidationInfo) -> float:
    """Returns the width [s] itself. Raises PydanticCustomError for one with which every bracket is right."""
    shortest, longest = info.data.get("search_s", (0, width_s + 1))
    if width_s >= longest - shortest:
        span = {"span": f"{longest - shortest:g}"}
        raise PydanticCustomError("width", "must be less than the range of the search, which is {span} s wide", span)
    return width_s


def check_integrators(names: tuple[IntegratorName, ...]) -> tuple[IntegratorName, ...]:
    """Returns the names themselves. Raises PydanticCustomError where one is repeated."""
    if len(set(names)) < len(names):
        raise PydanticCustomError("integrators", "names an integrator twice: name each once")
    return names


class ThresholdParameters(ExerciseParameters):
    """Search and width in s, horizon in s; `start` names joints of one degree of freedom [rad or m]."""

    model: str
    start: dict[str, Real] = Field(min_length=1)
    search_s: Annotated[Range, AfterValidator(check_search)] = Range(0.001, 0.050)
    horizon_s: Annotated[Positive, AfterValidator(check_horizon)] = Field(default=3.0, le=60, validate_default=True)
    width_s: Annotated[float, AfterValidator(check_width)] = Field(default=0.0005, ge=1e-6, validate_default=True)
    integrators: Annotated[tuple[IntegratorName, ...], AfterValidator(check_integrators)] = Field(min_length=1)


@dataclass(frozen=True)
class Cell:
    """One model under one integrator. Both scenes begin at `start`, a joint's name with its position [rad or m].
    `scene_as_written` lacks the drawn numbers. A scene is compiled on its first use, once for all integrators."""

    case: str
    xml: str
    xml_as_written: str
    start: tuple[tuple[str, float], ...]
    integrator: Integrator

    @cached_property
    def scene(self) -> Scene:
        """The scene of the case. Raises WrongParameter, ValueError."""
        return pose_scene(self.xml, self.start)

    @property
    def rest(self) -> Scene | None:
        """The scene in its equilibrium; None if there is none."""
        return find_equilibrium(self.scene)

    @cached_property
    def scene_as_written(self) -> Scene:
        """The scene of the model as its author wrote it. Raises as `scene`."""
        return pose_scene(self.xml_as_written, self.start)


@lru_cache(maxsize=64)
def pose_scene(xml: str, start: tuple[tuple[str, float], ...]) -> Scene:
    """Returns the scene of a model with the joints of `start` moved. Raises WrongParameter, ValueError."""
    scene = Scene.from_xml(xml)
    qpos = np.array(scene.start.qpos)
    for joint, value in start:
        try:
            where = scene.find_qpos(joint)
        except KeyError as error:
            raise WrongParameter(f"start.{joint}", str(error.args[0])) from error
        if where.stop - where.start != 1:
            raise WrongParameter(f"start.{joint}", f"joint {joint!r} has more than one coordinate")
        qpos[where] = value
    return scene.at(qpos=qpos)


def build_cells(parameters: ThresholdParameters, drawn: DrawnCase[Case]) -> Sequence[Cell]:
    """Returns a case's cells, one for each integrator."""
    make_cell = partial(Cell, drawn.case.id, drawn.xml, drawn.xml_as_written, tuple(parameters.start.items()))
    return [make_cell(BY_NAME[name]) for name in parameters.integrators]
