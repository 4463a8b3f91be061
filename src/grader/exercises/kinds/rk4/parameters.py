"""The parameters of an `rk4` exercise, and the runs that they define."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import mujoco
import numpy as np
from mujoco import mjtJoint
from pydantic import Field

from grader.exercises.kind import DrawnCase
from grader.exercises.parameters import Case, ExerciseParameters, Strict
from grader.numerics.runge_kutta import check_supported
from grader.numerics.scene import Scene

ACCELERATION = 1.0
"""Size of the hidden force as an acceleration [m/s2, rad/s2].

Source: measured; it leaves honest code at 2e-14 and moves any route through mj_step by more than 1e-2 in a second.
"""

RATE = 5.0
"""Angular frequency of the force of a time-dependent case [rad/s]."""

PROBE_SPEED = 3.0
"""What a slope of the probe adds to a velocity within a step [m/s, rad/s]: more than round-off by 15 decades."""

PROBE_TIMESTEPS = (1.0, 1.25)
"""Timesteps of the probe, as multiples of the case's: they tell h from a number of the same size."""

PROBE_EQUATIONS = 8
"""Equations for each coefficient row, beside those of the run; a row of the classical method has four unknowns."""

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

    start: Start = Start()
    timestep_s: float = Field(default=0.002, gt=0, le=0.1)
    steps: int = Field(default=500, ge=2, le=5000)
    tolerance: float = Field(default=1e-10, gt=0)
    time_matters: bool = False


class OrderCheck(Strict):
    """The observed order on the first case: the slope of log error over log timestep."""

    timesteps_s: Floats = Field(default=(0.004, 0.002, 0.001, 0.0005), min_length=3)
    seconds: float = Field(default=0.3, gt=0, le=5)
    tolerance: float = Field(default=0.2, gt=0)
    points: float = Field(default=1.0, gt=0)


class Rk4Parameters(ExerciseParameters):
    """`accept`: agreement with MuJoCo's own method, or also another method of proven fourth order."""

    accept: Literal["mujoco", "mujoco or fourth order"] = "mujoco"
    cases: tuple[Rk4Case, ...] = Field(min_length=1)
    order: OrderCheck | None = OrderCheck()


@dataclass(frozen=True)
class Force:
    """The hidden force a sin(P q + V v + w t + p); see driver.py."""

    amplitude: Floats
    position: Matrix
    velocity: Matrix
    phase: Floats
    rate: float


@dataclass(frozen=True)
class Probe:
    """Single steps after the runs of the first case, under a strong force; see driver.py.

    `starts`: of each step `timestep_s`, `time` [s], `qpos`, `qvel`, `act` and `ctrl`.
    """

    force: Force
    starts: tuple[Mapping[str, Any], ...]


@dataclass(frozen=True)
class Run:
    """One run of the student's step; hashable, so that our own simulation of it is cached."""

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
    """The problem of one trial: the run of a case, or, if `asks_order`, its runs at several timesteps.

    `order` and `order_runs` belong to the first case alone. `accepts_other_methods`: another method of fourth order is
    right as well.
    """

    case: Rk4Case
    run: Run
    accepts_other_methods: bool
    order: OrderCheck | None = None
    order_runs: tuple[Run, ...] = ()
    asks_order: bool = False
    probe: Probe | None = None

    @property
    def runs(self) -> tuple[Run, ...]:
        """The runs of this trial."""
        return self.order_runs if self.asks_order else (self.run,)

    def inputs(self) -> dict[str, Any]:
        """Returns the inputs of the driver."""
        probe = {"force": vars(self.probe.force), "starts": list(self.probe.starts)} if self.probe else None
        return ({"probe": probe} if probe and not self.asks_order else {}) | {
            "taped": not self.asks_order,
            "model": self.run.xml,
            "start": {name: list(getattr(self.run, name)) for name in ("qpos", "qvel", "act", "ctrl")},
            "force": vars(self.run.force),
            "runs": [{"timestep_s": run.timestep_s, "steps": run.steps} for run in self.runs],
        }


def pose_case(parameters: Rk4Parameters, drawn: DrawnCase[Rk4Case]) -> Problem:
    """Draws the force of a case. Raises ValueError and KeyError for a start that the model does not have."""
    case, xml = drawn.case, drawn.xml
    scene = Scene.from_xml(xml, key=case.start.key)
    check_supported(scene.model)
    check_muscles(xml)
    start = scene.at(**case.start.model_dump(exclude={"key"})).start
    qpos, qvel, act, ctrl = (tuple(part.tolist()) for part in (start.qpos, start.qvel, start.act, start.ctrl))
    force = draw_force(scene.model, drawn.rng, RATE if case.time_matters else 0.0)
    run = Run(xml, qpos, qvel, act, ctrl, case.timestep_s, case.steps, force)
    problem = Problem(case, run, parameters.accept != "mujoco")
    check = parameters.order
    if case.id != parameters.cases[0].id:
        return problem
    problem = replace(problem, probe=draw_probe(scene.model, run, drawn.rng))
    if check is None:
        return problem
    order_runs = tuple(retimed(run, h, round(check.seconds / h)) for h in check.timesteps_s)
    return replace(problem, order=check, order_runs=order_runs)


def check_muscles(xml: str) -> None:
    """Raises ValueError for a muscle without `lengthrange`: MuJoCo simulates to find it, which the jail refuses."""
    for actuator in mujoco.MjSpec.from_string(xml).actuators:
        if actuator.gaintype == mujoco.mjtGain.mjGAIN_MUSCLE and not any(actuator.lengthrange):
            raise ValueError(f"give the muscle {actuator.name!r} its lengthrange")


def retimed(run: Run, timestep_s: float, steps: int) -> Run:
    """Returns the same run at another timestep."""
    return replace(run, timestep_s=timestep_s, steps=steps)


def draw_probe(model: mujoco.MjModel, run: Run, rng: np.random.Generator) -> Probe:
    """Draws states near the start of a run, and a force that changes much within a step."""
    h = run.timestep_s
    drawn = draw_force(model, rng, PROBE_SPEED / 4 / h)
    strong = Force(
        amplitude=tuple(a * PROBE_SPEED / h / ACCELERATION for a in drawn.amplitude),
        position=tuple(tuple(p / 10 / h / PROBE_SPEED for p in row) for row in drawn.position),
        velocity=tuple(tuple(4 * v for v in row) for row in drawn.velocity),
        phase=drawn.phase,
        rate=drawn.rate,
    )
    starts = []
    for index in range(int(np.clip(np.ceil(PROBE_EQUATIONS / model.nv), len(PROBE_TIMESTEPS), PROBE_EQUATIONS))):
        qpos = np.array(run.qpos)
        mujoco.mj_integratePos(model, qpos, rng.normal(size=model.nv), 0.1)
        start = {
            "timestep_s": h * PROBE_TIMESTEPS[index % len(PROBE_TIMESTEPS)],
            "time": rng.uniform(0.1, 1),
            "qpos": qpos.tolist(),
            "qvel": rng.normal(scale=PROBE_SPEED, size=model.nv).tolist(),
            "act": (np.array(run.act) + rng.uniform(0, 0.1, len(run.act))).tolist(),
            "ctrl": list(run.ctrl),
        }
        starts.append(start)
    return Probe(strong, tuple(starts))


def draw_force(model: mujoco.MjModel, rng: np.random.Generator, rate: float) -> Force:
    """Draws a force of ACCELERATION in every dof; it does not depend on quaternions, whose sign and length are free."""
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
