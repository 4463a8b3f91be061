"""The parameters of exercises about episodes, and the episodes that they define."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, Self, TypeVar

import mujoco
import numpy as np
from mujoco import mjtObj
from pydantic import Field, model_validator

from grader.domain.numbers import NotNegative, Points, Positive, Range, Real, Value
from grader.exercises.episodes.environment import NO_ENVIRONMENT, Environment
from grader.exercises.kind import DrawnCase
from grader.exercises.parameters import (
    CASES_MAX,
    Case,
    ExerciseParameters,
    Strict,
    WrongParameter,
    draw_number,
    write_numbers,
)
from grader.numerics.plant import Plant
from grader.numerics.scene import Scene

ASKS_MAX = 100_000
"""Most control periods in one exercise: 3 s of computing for the channel to a script alone."""

STEPS_MAX = 2_000_000
"""Most steps of the simulation in one exercise."""

T = TypeVar("T")

GoalName = Literal["rms", "error", "overshoot", "settling", "effort", "energy", "chatter", "range", "return"]


class Goal(Strict):
    """What an episode must achieve from `from_s` on: a measure of the tracked sensor, of the controls, or of `sensor`,
    and its largest value. `settling` needs a `band` in units of the sensor. In place of `max`, `range` needs a
    `within`, and `return`, the sum of an author's rewards, its least value `min`."""

    goal: GoalName
    max: Positive | None = None
    min: Real | None = None
    within: Range | None = None
    band: Positive | None = None
    sensor: str | None = None
    from_s: NotNegative = 0.0
    title: str | None = None
    points: Points = 1.0

    @model_validator(mode="after")
    def _check(self) -> Self:
        limit = {"range": "within", "return": "min"}.get(self.goal, "max")
        for name, how in (("max", ", the largest value"), ("within", ": [low, high]"), ("min", ", the least value")):
            if (getattr(self, name) is None) == (name == limit):
                raise ValueError(f'give "{name}"{how}' if name == limit else f'"{name}" is not for "{self.goal}"')
        if (self.band is None) == (self.goal == "settling"):
            raise ValueError('give "band"' if self.goal == "settling" else '"band" is for "settling" alone')
        return self


class TargetStep(Strict):
    """The target from a moment on."""

    at_s: NotNegative = 0.0
    value: Value


class Load(Strict):
    """A constant force [N or N m] on a joint, from a moment on."""

    joint: str
    force: Value
    from_s: NotNegative = 0.0


class EpisodesCase(Case):
    """One drawn episode, or `episodes` of them, of which a `share` must reach every goal. `start` names joints of one
    degree of freedom, `start_velocity` too. `delay_s` is the age of what is observed; `noise` names observed sensors
    with the standard deviation of a reading."""

    key: str | None = None
    start: dict[str, Value] = Field(default_factory=dict)
    start_velocity: dict[str, Value] = Field(default_factory=dict)
    target: tuple[TargetStep, ...] = Field(default=(), max_length=20)
    load: Load | None = None
    delay_s: Value = 0.0
    noise: dict[str, NotNegative] = Field(default_factory=dict)
    episodes: int = Field(default=1, ge=1, le=200)
    share: float = Field(default=1.0, gt=0, le=1)


class EpisodesParameters(ExerciseParameters):
    """`track` and `observe` name sensors of the model."""

    model: str
    period_s: Positive
    duration_s: Positive = Field(le=120)
    observe: tuple[str, ...] = Field(default=(), max_length=20)
    track: str
    goals: tuple[Goal, ...] = Field(min_length=1, max_length=12)
    cases: tuple[EpisodesCase, ...] = Field(min_length=1, max_length=CASES_MAX)

    @model_validator(mode="after")
    def _check_size(self) -> Self:
        asks = sum(case.episodes for case in self.cases) * self.duration_s / self.period_s
        if asks > ASKS_MAX:
            raise ValueError(f"the controls would be computed {asks:.0f} times; at most {ASKS_MAX} are possible")
        for case in self.cases:
            if unknown := case.noise.keys() - {*self.observe}:
                raise ValueError(f"`noise` names {min(unknown)}, which is not in `observe`")
        return self

    @property
    def has_target(self) -> bool:
        """Whether what is observed ends with a target."""
        return any(case.target for case in self.cases)


@dataclass(frozen=True, eq=False)
class Episode:
    """One run with its drawn numbers. `targets` are (moment [s], value); `noise` (steps, width) is added to what is
    observed, `delay` is in control periods."""

    xml: str
    key: str | None
    start: Mapping[str, float]
    start_velocity: Mapping[str, float]
    targets: Sequence[tuple[float, float]]
    load: tuple[str, float, float] | None
    delay: int
    noise: Mapping[str, float]
    seed: int

    @cached_property
    def scene(self) -> Scene:
        """The scene at its start. Raises WrongParameter, ValueError and KeyError."""
        scene = Scene.from_xml(self.xml, key=self.key)
        qpos, qvel = np.array(scene.start.qpos), np.array(scene.start.qvel)
        for joint, value in self.start.items():
            where = scene.find_qpos(joint)
            if where.stop - where.start != 1:
                raise WrongParameter(f"start.{joint}", f"joint {joint!r} has more than one coordinate")
            qpos[where] = value
        for joint, value in self.start_velocity.items():
            qvel[scene.model.jnt_dofadr[scene.find_id(mjtObj.mjOBJ_JOINT, joint)]] = value
        return scene.at(qpos=qpos, qvel=qvel)

    def find_target(self, time_s: float) -> float:
        """Returns the target at a moment; 0 where there is none."""
        for at_s, value in reversed(self.targets):
            if time_s >= at_s - 1e-9:
                return value
        return 0.0


@dataclass(frozen=True, eq=False)
class Problem:
    """The episodes of one case. `steps` are those of the simulation in a control period. The functions of the author's
    `environment`, where there are any, stand in place of `observe`."""

    case: EpisodesCase
    episodes: tuple[Episode, ...]
    steps: int
    periods: int
    model: mujoco.MjModel
    environment: Environment = NO_ENVIRONMENT


def pose_case(
    parameters: EpisodesParameters, drawn: DrawnCase[EpisodesCase], environment: Environment = NO_ENVIRONMENT
) -> Problem:
    """Returns the problem of one case, with every number drawn anew in each episode. Raises ValueError, KeyError."""
    case, rng = drawn.case, drawn.rng
    model = Scene.from_xml(drawn.xml_as_written).model
    steps = round(parameters.period_s / model.opt.timestep)
    if steps < 1 or abs(steps * model.opt.timestep - parameters.period_s) > 1e-6 * parameters.period_s:
        raise WrongParameter("period_s", f"must be a multiple of the model's timestep, {model.opt.timestep:g} s")
    periods = round(parameters.duration_s / parameters.period_s)
    if periods < 2 or steps * periods * sum(case.episodes for case in parameters.cases) > STEPS_MAX:
        raise WrongParameter("duration_s", f"takes less than 2 periods, or more than {STEPS_MAX} steps in all")
    if not model.nu:
        raise WrongParameter("model", "has no actuator to control")
    episodes = []
    for index in range(case.episodes):
        numbers = drawn.numbers
        if index:
            numbers = {name: draw_number(value, rng) for name, value in case.set.items()}
        xml = write_numbers(drawn.xml_as_written, parameters.numbers, numbers) if numbers else drawn.xml
        load = (case.load.joint, draw_number(case.load.force, rng), case.load.from_s) if case.load else None
        episodes.append(
            Episode(
                xml,
                case.key,
                {joint: draw_number(value, rng) for joint, value in case.start.items()},
                {joint: draw_number(value, rng) for joint, value in case.start_velocity.items()},
                [(step.at_s, draw_number(step.value, rng)) for step in case.target],
                load,
                round(draw_number(case.delay_s, rng) / parameters.period_s),
                case.noise,
                int(rng.integers(2**32)),
            )
        )
    return Problem(case, tuple(episodes), steps, periods, model, environment)


def find_named(find: Callable[[str], T], name: str, key: str) -> T:
    """Returns what is found by a name. Raises WrongParameter at `key` where there is nothing."""
    try:
        return find(name)
    except KeyError as error:
        raise WrongParameter(key, str(error.args[0])) from error


def check_names(parameters: EpisodesParameters, problem: Problem) -> None:
    """Raises ValueError or KeyError where a name in the parameters is not one of the model, or is no number."""
    plant = Plant(problem.episodes[0].scene)
    measured = {f"goals.{index}.sensor": goal.sensor for index, goal in enumerate(parameters.goals) if goal.sensor}
    for key, name in {"track": parameters.track, **measured}.items():
        where = find_named(plant.find_sensor, name, key)
        if where.stop - where.start != 1:
            raise WrongParameter(key, f"sensor {name!r} has more than one number")
    for index, name in enumerate(parameters.observe):
        find_named(plant.find_reading, name, f"observe.{index}")
    if problem.environment.reward is None and any(goal.goal == "return" for goal in parameters.goals):
        why = (
            "`return` needs a `program` that defines reward(model, data, controls), which `policy` exercises alone have"
        )
        raise WrongParameter("goals", why)
    if problem.case.load is not None:
        plant.find_dof(problem.case.load.joint)
    if problem.case.target and [step.at_s for step in problem.case.target] != sorted(
        step.at_s for step in problem.case.target
    ):
        raise WrongParameter("target", "the moments of its steps must rise")
    if any(isinstance(value, tuple) and value[0] < 0 for value in (problem.case.delay_s,)):
        raise WrongParameter("delay_s", "may not be negative")
