"""The parameters of a `model` exercise, and the problem of a case."""

import ast
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal, Self

import mujoco
from pydantic import Field, model_validator

from grader.domain.numbers import NotNegative, Points, Positive, Range, Value
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

STEPS_MAX = 20_000
"""Most steps of a run: with half the timestep twice as many are simulated, of two models."""

NAMES = {
    "model",
    "data",
    "fullinertia",
    "np",
    "mujoco",
    "abs",
    "max",
    "min",
    "sum",
    "len",
    "float",
    "bool",
    "int",
    "range",
    "any",
    "all",
}
"""What an expression may name, beside its own variables."""

MOMENTS = re.compile(r"model\.body\(.*\)\.inertia|model\.body_inertia(?:\[.*\])?")
"""Expressions that are not the same in every right model."""


class Goal(Strict):
    """What a model must have or do, which gives a finding. Python expressions over `model` and `data` are `same` as
    those of the reference, within `rtol` of the largest number and `atol`; and `within` a range, always or at the end
    of the run."""

    title: str | None = None
    points: Points = 1.0
    same: tuple[str, ...] = Field(default=(), max_length=20)
    rtol: NotNegative = Field(default=1e-3, le=1)
    atol: Positive = 1e-6
    within: dict[str, Range] = Field(default_factory=dict, max_length=20)
    when: Literal["end", "always"] = "end"

    @model_validator(mode="after")
    def _check(self) -> Self:
        if not self.same and not self.within:
            raise ValueError('give "same" or "within"')
        for expression in (*self.same, *self.within):
            check_expression(expression)
        if moments := next(filter(MOMENTS.fullmatch, self.same), None):
            why = "has the principal moments in an order that the compiler chooses: right models differ in it"
            raise ValueError(f"{moments} {why}. Write fullinertia('name of the body')")
        return self


class ModelCase(Case):
    """One look at the model, or one run of `seconds` [s] from a `start`: joints by name, of one degree of freedom, with
    the controls `ctrl` of actuators by name."""

    start: dict[str, Value] = Field(default_factory=dict)
    start_velocity: dict[str, Value] = Field(default_factory=dict)
    ctrl: dict[str, Value] = Field(default_factory=dict)
    seconds: NotNegative = Field(default=0.0, le=60)
    goals: tuple[Goal, ...] = Field(min_length=1, max_length=20)


class ModelParameters(ExerciseParameters):
    """`reference` is the path of a right model in the content folder, which no learner is shown. A program's function
    gets the `numbers` that the case sets, in their order."""

    reference: str = Field(min_length=1)
    cases: tuple[ModelCase, ...] = Field(min_length=1, max_length=CASES_MAX)


@dataclass(frozen=True, eq=False)
class Problem:
    """The goals of one case, and what the measuring program gets: the MJCF of the reference, with the drawn numbers,
    and where a run begins. `numbers` are those drawn, `write` makes the reference with others."""

    case: ModelCase
    measured: Mapping[str, Any]
    numbers: Mapping[str, float]
    write: Callable[[Mapping[str, float]], str]

    @property
    def reference(self) -> str:
        """The MJCF of the reference."""
        return str(self.measured["reference"])


def pose_case(parameters: ModelParameters, drawn: DrawnCase[ModelCase]) -> Problem:
    """Returns the problem of one case. Raises WrongParameter, ValueError and GraderError."""
    case = drawn.case
    text = drawn.content.text_of(parameters.reference)

    def write(numbers: Mapping[str, float]) -> str:
        return write_numbers(text, parameters.numbers, numbers) if numbers else text

    xml = write(drawn.numbers)
    try:
        model = mujoco.MjModel.from_xml_string(xml)
    except (ValueError, mujoco.FatalError) as error:
        raise WrongParameter("reference", f"{parameters.reference} cannot be compiled: {error}") from error
    if case.seconds / model.opt.timestep > STEPS_MAX:
        raise ValueError(f"a run of {case.seconds:g} s takes more than {STEPS_MAX} steps of the reference: shorten it")
    check_names(model, case)
    drawn_values = {
        part: {name: draw_number(value, drawn.rng) for name, value in getattr(case, part).items()}
        for part in ("start", "start_velocity", "ctrl")
    }
    goals = [{"same": list(goal.same), "within": list(goal.within)} for goal in case.goals]
    return Problem(
        case,
        {
            "reference": xml,
            "goals": goals,
            "seconds": case.seconds,
            "timestep": model.opt.timestep,
            **drawn_values,
        },
        drawn.numbers,
        write,
    )


def check_names(model: mujoco.MjModel, case: ModelCase) -> None:
    """Raises ValueError where a case begins with a joint or actuator that the reference lacks."""
    for part, kind in (("start", "joint"), ("start_velocity", "joint"), ("ctrl", "actuator")):
        for name in getattr(case, part):
            try:
                item = getattr(model, kind)(name)
            except KeyError as error:
                raise ValueError(f"`{part}` names the {kind} {name!r}, which the reference lacks") from error
            if kind == "joint" and int(item.type[0]) not in (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE):
                raise ValueError(f"`{part}` names the joint {name!r}, which has more than one degree of freedom")


def check_expression(expression: str) -> None:
    """Raises ValueError for what is no expression over `model` and `data`."""
    try:
        tree = ast.parse(expression, mode="eval")
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise ValueError(f"{expression!r} is no Python expression, such as model.body('arm').mass") from error
    own = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)}
    unknown = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)} - NAMES - own
    if unknown:
        raise ValueError(f"{expression!r} names {min(unknown)}: an expression has {', '.join(sorted(NAMES))}")


def list_asked_names(expression: str) -> Iterator[tuple[str, str]]:
    """Yields kind and name of each element that an expression asks for, as in `model.joint('hip')`; the functions that
    expressions have of their own ask for bodies."""
    for node in ast.walk(ast.parse(expression, mode="eval")):
        if isinstance(node, ast.Call) and len(node.args) == 1:
            name = getattr(node.args[0], "value", None)
            if isinstance(name, str):
                yield "body" if isinstance(node.func, ast.Name) else getattr(node.func, "attr", ""), name
