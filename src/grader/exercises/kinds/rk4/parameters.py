"""The parameters of an `rk4` exercise, and the runs that they define."""

from dataclasses import replace
from typing import Annotated, Literal

import mujoco
import numpy as np
from mujoco import mjtJoint
from pydantic import AfterValidator, Field, ValidationInfo
from pydantic_core import PydanticCustomError

from grader.domain.numbers import Points, Positive, Real
from grader.exercises.kind import DrawnCase
from grader.exercises.kinds.rk4.judging.run import Force, OrderMeasurement, Probe, Problem, Run, with_timestep
from grader.exercises.parameters import CASES_MAX, Case, ExerciseParameters, Strict, WrongParameter
from grader.numerics.accuracy.runge_kutta import check_supported
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

STEPS_MIN, STEPS_MAX = 5, 5000
"""Steps of a run that is compared with the exact motion, which takes five samples of it."""

TIMESTEP_MIN_S, TIMESTEP_MAX_S = 1e-6, 0.1

MOTION_MAX = 5.0
"""What a start may move by in a step [rad, m]: the exact motion of a faster one takes minutes to solve."""

Timestep = Annotated[float, Field(ge=TIMESTEP_MIN_S, le=TIMESTEP_MAX_S)]
Reals = Annotated[tuple[Real, ...], Field(max_length=10_000)]
Tolerance = Annotated[float, Field(ge=1e-16, le=1)]


def check_distinct(timesteps_s: tuple[float, ...]) -> tuple[float, ...]:
    """Returns the timesteps themselves. Raises PydanticCustomError where one is repeated."""
    if len(set(timesteps_s)) < len(timesteps_s):
        raise PydanticCustomError("timesteps", "has a timestep twice, and a slope needs different ones: change one")
    return timesteps_s


def check_length(seconds: float, info: ValidationInfo) -> float:
    """Returns the length of the runs [s] itself. Raises PydanticCustomError where one has too few or too many steps."""
    timesteps_s = info.data.get("timesteps_s", (seconds / STEPS_MIN,))
    least, most = STEPS_MIN * max(timesteps_s), STEPS_MAX * min(timesteps_s)
    if not least <= seconds <= most:
        limits = {"least": f"{least:g}", "fewest": STEPS_MIN, "most": f"{most:g}", "steps": STEPS_MAX}
        why = "must be from {least} ({fewest} steps of the largest timestep) to {most} ({steps} of the smallest)"
        raise PydanticCustomError("length", why, limits)
    return seconds


class Start(Strict):
    """Where a run begins: a keyframe, and parts that replace its own."""

    key: str | None = None
    qpos: Reals | None = None
    qvel: Reals | None = None
    act: Reals | None = None
    ctrl: Reals | None = None


class Rk4Case(Case):
    """One run. `time_matters`: the hidden force depends on data.time, and data.time itself is checked."""

    start: Start = Start()
    timestep_s: Timestep = 0.002
    steps: int = Field(default=500, ge=2, le=STEPS_MAX)
    tolerance: Tolerance = 1e-10
    time_matters: bool = False


class OrderCheck(Strict):
    """The observed order on the first case: the slope of log error over log timestep."""

    timesteps_s: Annotated[tuple[Timestep, ...], AfterValidator(check_distinct)] = Field(
        default=(0.004, 0.002, 0.001, 0.0005), min_length=3, max_length=8
    )
    seconds: Annotated[Positive, AfterValidator(check_length)] = Field(default=0.3, le=5, validate_default=True)
    tolerance: Positive = Field(default=0.2, le=1)
    points: Points = 1.0


class Rk4Parameters(ExerciseParameters):
    """`accept`: agreement with MuJoCo's own method, or also another method of proven fourth order."""

    accept: Literal["mujoco", "mujoco or fourth order"] = "mujoco"
    cases: tuple[Rk4Case, ...] = Field(min_length=1, max_length=CASES_MAX)
    order: OrderCheck | None = OrderCheck()


def pose_case(parameters: Rk4Parameters, drawn: DrawnCase[Rk4Case]) -> Problem:
    """Draws the force of a case. Raises ValueError and KeyError for a start that the model does not have."""
    case, xml = drawn.case, drawn.xml
    scene = Scene.from_xml(xml, key=case.start.key)
    check_supported(scene.model)
    check_muscles(scene.model, xml)
    start = scene.at(**case.start.model_dump(exclude={"key"})).start
    qpos, qvel, act, ctrl = (tuple(part.tolist()) for part in (start.qpos, start.qvel, start.act, start.ctrl))
    if max(map(abs, qvel), default=0.0) * case.timestep_s > MOTION_MAX:
        why = f"a start.qvel of {max(qvel, key=abs):g} moves by more than {MOTION_MAX:g} rad or m in a step"
        raise ValueError(f"{why}, which no method follows: take a smaller one, or a smaller timestep_s")
    force = draw_force(scene.model, drawn.rng, RATE if case.time_matters else 0.0)
    run = Run(xml, qpos, qvel, act, ctrl, case.timestep_s, case.steps, force)
    problem = Problem(case.id, run, case.tolerance, case.time_matters, parameters.accept != "mujoco")
    if problem.accepts_other_methods and case.steps < STEPS_MIN:
        raise WrongParameter("accept", f"{parameters.accept!r} needs cases of {STEPS_MIN} steps or more: {case.id}")
    check = parameters.order
    if case.id != parameters.cases[0].id:
        return problem
    problem = replace(problem, probe=draw_probe(scene.model, run, drawn.rng))
    if check is None:
        return problem
    order_runs = tuple(with_timestep(run, h, round(check.seconds / h)) for h in check.timesteps_s)
    return replace(problem, order=OrderMeasurement(check.timesteps_s, check.tolerance), order_runs=order_runs)


def check_muscles(model: mujoco.MjModel, xml: str) -> None:
    """Raises ValueError for a muscle without `lengthrange`: MuJoCo simulates to find it, which the jail refuses."""
    if not np.any(model.actuator_gaintype == mujoco.mjtGain.mjGAIN_MUSCLE):
        return
    for actuator in mujoco.MjSpec.from_string(xml).actuators:
        if actuator.gaintype == mujoco.mjtGain.mjGAIN_MUSCLE and not any(actuator.lengthrange):
            raise ValueError(f"give the muscle {actuator.name!r} its lengthrange")


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
