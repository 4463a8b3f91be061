"""What an author writes in the JSON of an `rk4` exercise, and the runs that come of it."""

from dataclasses import dataclass
from typing import Any, Literal, Self

import mujoco
import numpy as np
from mujoco import mjtJoint
from pydantic import Field, model_validator

from grader.grading.parameters import Case, Strict, case_titles, drawn
from grader.grading.plan import ModelXml
from grader.grading.variant import Number, with_numbers
from grader.numerics.rk4 import check_supported
from grader.numerics.scene import Scene

ACCELERATION = 1.0
"""Size of the hidden force as an acceleration [m/s2, rad/s2].

Source: measured; it leaves honest code at 2e-14 and moves any route through mj_step by more than 1e-2 in a second.
"""

RATE = 5.0
"""How fast the force of a time-dependent case changes [rad/s]."""

Floats = tuple[float, ...]
Matrix = tuple[Floats, ...]


class Start(Strict):
    """Where a run begins: a keyframe, and parts that replace its own."""

    key: str | None = None
    qpos: Floats | None = None
    qvel: Floats | None = None
    act: Floats | None = None
    ctrl: Floats | None = None


class Rk4Case(Case):
    """One run. `time_matters`: the hidden force depends on data.time, and data.time itself is checked."""

    model: str | None = None
    xml: str | tuple[str, ...] | None = None
    start: Start = Start()
    timestep_s: float = Field(default=0.002, gt=0, le=0.1)
    steps: int = Field(default=500, ge=2, le=5000)
    tolerance: float = Field(default=1e-10, gt=0)
    time_matters: bool = False
    hint: str | None = None

    @model_validator(mode="after")
    def _check_model(self) -> Self:
        if (self.model is None) == (self.xml is None):
            raise ValueError("give either `model` (a name in models/) or `xml` (MJCF text)")
        return self


class OrderCheck(Strict):
    """The observed order on the first case: the slope of log error over log timestep."""

    timesteps_s: Floats = Field(default=(0.004, 0.002, 0.001, 0.0005), min_length=3)
    seconds: float = Field(default=0.3, gt=0, le=5)
    tolerance: float = Field(default=0.2, gt=0)
    points: float = Field(default=1.0, gt=0)


class Rk4Parameters(Strict):
    """`accept`: agreement with MuJoCo's own method, or also another method of proven fourth order."""

    accept: Literal["mujoco", "mujoco or fourth order"] = "mujoco"
    numbers: dict[str, Number] = Field(default_factory=dict)
    cases: tuple[Rk4Case, ...] = Field(min_length=1)
    order: OrderCheck | None = OrderCheck()


@dataclass(frozen=True)
class Force:
    """The hidden force a sin(P q + V v + w t + p); see drivers/hidden_force.py."""

    amplitude: Floats
    position: Matrix
    velocity: Matrix
    phase: Floats
    rate: float


@dataclass(frozen=True)
class Run:
    """One run of the student's step: hashable, so that our own simulation of it is done once."""

    xml: str
    qpos: Floats
    qvel: Floats
    act: Floats
    ctrl: Floats
    timestep_s: float
    steps: int
    force: Force

    def scene(self) -> Scene:
        """The run's scene at its start."""
        return Scene.from_xml(self.xml).at(qpos=self.qpos, qvel=self.qvel, act=self.act, ctrl=self.ctrl)


@dataclass(frozen=True)
class Problem:
    """The runs of one submission: one for each case, in order, then one for each timestep of the order check."""

    parameters: Rk4Parameters
    titles: tuple[str, ...]
    runs: tuple[Run, ...]

    @property
    def may_converge(self) -> bool:
        """Whether another method of proven fourth order is right as well."""
        return self.parameters.accept != "mujoco"

    @property
    def order_runs(self) -> tuple[int, ...]:
        """Indices of the runs at the timesteps of the order check."""
        return tuple(range(len(self.parameters.cases), len(self.runs)))


def pose_run(case: Rk4Case, numbers: dict[str, Number], model_xml: ModelXml, seed: list[int]) -> Run:
    """Draw the case's numbers and its force. Raises ValueError, KeyError, GraderError."""
    rng = np.random.default_rng(seed)
    xml = model_xml(case.model) if case.model else case.xml if isinstance(case.xml, str) else "\n".join(case.xml or ())
    xml = with_numbers(xml, numbers, {name: drawn(value, rng) for name, value in case.set.items()})
    scene = Scene.from_xml(xml, key=case.start.key)
    check_supported(scene.model)
    start = scene.at(**case.start.model_dump(exclude={"key"})).start
    qpos, qvel, act, ctrl = (tuple(part.tolist()) for part in (start.qpos, start.qvel, start.act, start.ctrl))
    force = draw_force(scene.model, rng, RATE if case.time_matters else 0.0)
    return Run(xml, qpos, qvel, act, ctrl, case.timestep_s, case.steps, force)


def draw_force(model: mujoco.MjModel, rng: np.random.Generator, rate: float) -> Force:
    """A force of ACCELERATION in every dof; it leaves quaternions alone, whose sign and length are free."""
    position = rng.normal(size=(model.nv, model.nq))
    for kind, at in zip(model.jnt_type.tolist(), model.jnt_qposadr.tolist(), strict=True):
        if kind == int(mjtJoint.mjJNT_FREE):
            position[:, at + 3 : at + 7] = 0
        elif kind == int(mjtJoint.mjJNT_BALL):
            position[:, at : at + 4] = 0
    return Force(
        amplitude=tuple((ACCELERATION * model.dof_M0).tolist()),
        position=tuple(map(tuple, position.tolist())),
        velocity=tuple(map(tuple, rng.normal(scale=0.2, size=(model.nv, model.nv)).tolist())),
        phase=tuple(rng.uniform(0, 2 * np.pi, model.nv).tolist()),
        rate=rate,
    )


def pose_problem(parameters: Rk4Parameters, model_xml: ModelXml, seed: int) -> Problem:
    """Every run of a submission. Raises ValueError, KeyError, GraderError."""
    numbers = parameters.numbers
    runs = [pose_run(case, numbers, model_xml, [seed, index]) for index, case in enumerate(parameters.cases)]
    if parameters.order:
        first, seconds = runs[0], parameters.order.seconds
        runs += [replaced(first, h, round(seconds / h)) for h in parameters.order.timesteps_s]
    return Problem(parameters, case_titles(parameters.cases), tuple(runs))


def replaced(run: Run, timestep_s: float, steps: int) -> Run:
    """The same run at another timestep."""
    parts: dict[str, Any] = {**vars(run), "timestep_s": timestep_s, "steps": steps}
    return Run(**parts)
