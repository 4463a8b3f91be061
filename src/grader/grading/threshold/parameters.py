"""What an author writes in the JSON of a `threshold` exercise, and the cells that come of it."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal, Self

import numpy as np
from pydantic import Field, model_validator

from grader.grading.parameters import Case, Strict, case_titles, drawn
from grader.grading.plan import ModelXml
from grader.grading.variant import Number, with_numbers
from grader.numerics.scene import Scene

IntegratorName = Literal["Euler", "RK4", "implicit", "implicitfast", "discrete"]
INTEGRATORS: dict[str, int] = {"Euler": 0, "RK4": 1, "implicit": 2, "implicitfast": 3, "discrete": 4}


class ThresholdParameters(Strict):
    """Search and width in s, horizon in s; `start` names joints of one degree of freedom [rad or m]."""

    model: str
    start: dict[str, float] = Field(min_length=1)
    horizon_s: float = Field(default=3.0, gt=0, le=60)
    search_s: tuple[float, float] = (0.001, 0.050)
    width_s: float = Field(default=0.0005, gt=0)
    integrators: tuple[IntegratorName, ...] = Field(min_length=1)
    numbers: dict[str, Number] = Field(default_factory=dict)
    cases: tuple[Case, ...] = Field(min_length=1)

    @model_validator(mode="after")
    def _check_search(self) -> Self:
        if not 1e-5 <= self.search_s[0] < self.search_s[1] <= 1:
            raise ValueError("search_s must be [shortest, longest], between 0.00001 and 1 s")
        return self


@dataclass(frozen=True)
class Cell:
    """One question put to the student's function: a model under an integrator."""

    id: str
    title: str
    hidden: bool
    points: float
    model: int
    """Index of its model among the plan's."""
    scene: Scene
    integrator: str

    @property
    def code(self) -> int:
        """The integrator as MuJoCo numbers it."""
        return INTEGRATORS[self.integrator]


@dataclass(frozen=True)
class Problem:
    """The cells of one submission, and the author's parameters."""

    parameters: ThresholdParameters
    models: tuple[str, ...]
    cells: tuple[Cell, ...]
    as_in_the_file: Scene


@lru_cache(maxsize=64)
def pose(xml: str, start: tuple[tuple[str, float], ...]) -> Scene:
    """The scene of a model with the joints of `start` moved. Raises ValueError, KeyError (an unknown joint)."""
    scene = Scene.from_xml(xml)
    qpos = np.array(scene.start.qpos)
    for joint, value in start:
        where = scene.qpos_of(joint)
        if where.stop - where.start != 1:
            raise ValueError(f"joint {joint!r} has more than one coordinate")
        qpos[where] = value
    return scene.at(qpos=qpos)


def pose_problem(parameters: ThresholdParameters, model_xml: ModelXml, seed: int) -> Problem:
    """Draw the hidden numbers and build every cell. Raises ValueError, KeyError, GraderError."""
    xml, start = model_xml(parameters.model), tuple(parameters.start.items())
    models: list[str] = []
    cells: list[Cell] = []
    for index, (case, title) in enumerate(zip(parameters.cases, case_titles(parameters.cases), strict=True)):
        rng = np.random.default_rng([seed, index])
        models.append(with_numbers(xml, parameters.numbers, {name: drawn(v, rng) for name, v in case.set.items()}))
        scene = pose(models[-1], start)
        share = case.points / len(parameters.integrators)
        cells.extend(
            Cell(f"{case.id}.{name}", f"{title}, {name}", case.hidden, share, index, scene, name)
            for name in parameters.integrators
        )
    return Problem(parameters, tuple(models), tuple(cells), pose(xml, start))
