"""The parameters of a `claims` exercise, and what is measured in one of its cases."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Any, Literal, Self

import mujoco
import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from grader.domain.lab import Expression, Seconds
from grader.domain.numbers import NotNegative, Points, Positive, Value
from grader.domain.quantities import QuantityName, Window
from grader.exercises.kind import DrawnCase
from grader.exercises.parameters import (
    CASES_MAX,
    STATE_PARTS,
    Case,
    ExerciseParameters,
    Start,
    Strict,
    WrongParameter,
    draw_number,
)

Floats = NDArray[np.float64]

CLAIMS_MAX = 12
"""Most claims of an exercise: each is a finding that a learner reads."""

OTHERS_MAX = 10
"""Most readings that a claim is compared with: each may be a run of its own."""

POINTS_MAX = 20
"""Most points of a curve: each is a run of its own where it has `apply`."""


class Formula(Strict):
    """A formula that learners may compute in place of measuring: its value `expr` at the start of a run, its `text` as
    learners know it, and a sentence that says `why` it does not hold."""

    expr: Expression
    text: str = Field(min_length=1)
    why: str = Field(min_length=1)


class OtherReading(Strict):
    """What learners may measure in place of `expr`: another expression, and `what` it is, as in "the speed of the tip,
    in m/s"."""

    expr: Expression
    what: str = Field(min_length=1)


class Claim(Window, Strict):
    """A quantity that the learner's function returns under its `name`, and how it is measured: in a run of `seconds`
    from the case's start, after `setup` and under `controller`, of the values of `expr` between `since` and `until`.
    The measured number is multiplied by `scale`, and is then in `unit`. A claim is right within `tol` plus `rtol` times
    the measured size; an `interval` is right where it `contains` (or `overlaps`) the measured number, and is no wider
    than `width`; a `curve` has a number for each x, compared in the `norm`. `timestep` and `fastest` are those of
    `verify`."""

    name: str = Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]*$")
    title: str | None = Field(default=None, min_length=1)
    quantity: QuantityName
    expr: Expression
    unit: str = ""
    scale: Positive = 1.0
    form: Literal["number", "interval", "curve"] = "number"
    tol: NotNegative = 0.0
    rtol: NotNegative = Field(default=0.02, lt=1)
    width: Positive | None = None
    rule: Literal["contains", "overlaps"] = "contains"
    norm: Literal["max", "rms"] = "max"
    points: Points = 1.0
    seconds: Seconds | None = None
    setup: Expression | None = None
    controller: Expression | None = None
    timestep: Literal["both", "any", "given"] = "both"
    fastest: Positive | None = None
    formula: Formula | None = None
    instead: tuple[OtherReading, ...] = Field(default=(), max_length=OTHERS_MAX)

    @model_validator(mode="after")
    def _check_parts(self) -> Self:
        if not self.tol + self.rtol:
            raise ValueError("give tol or rtol above 0: no measurement is exact")
        if (self.width is not None) != (self.form == "interval"):
            raise ValueError("give `width`, the largest width of an interval, with the form interval and only with it")
        self.require_used("quantity", self.quantity)
        if self.quantity == "trace" and self.form != "curve":
            raise ValueError("a trace is a curve: write the form curve")
        return self

    @property
    def label(self) -> str:
        """How sentences call it."""
        return self.title or self.name

    def allow(self, right: Floats) -> float:
        """Returns the largest difference at which a claim is right, in its unit; half the width of an interval that
        must contain the measured number."""
        if self.width is not None and self.rule == "contains":
            return self.width / 2
        return self.tol + self.rtol * float(np.max(np.abs(right), initial=0.0))


class Axis(Strict):
    """The x of curves. With `apply`, a statement over `value`, every x is a run of its own, which begins with it;
    without it x is the time [s] of a trace."""

    label: str = Field(min_length=1)
    unit: str = ""
    apply: Expression | None = None


class ClaimsCase(Case):
    """One start, and the x of its curves."""

    start: Start = Start()
    x: Annotated[tuple[Value, ...], Field(max_length=POINTS_MAX)] = ()


class ClaimsParameters(ExerciseParameters):
    """`seconds` is the length of every run whose claim has none of its own; `x` is what curves are over."""

    seconds: Seconds = 10.0
    x: Axis | None = None
    claims: tuple[Claim, ...] = Field(min_length=1, max_length=CLAIMS_MAX)
    cases: tuple[ClaimsCase, ...] = Field(min_length=1, max_length=CASES_MAX)


@dataclass(frozen=True)
class Experiment:
    """A run: the model, how it starts and what acts on it. `value` is what `apply` writes at its begin."""

    xml: str
    key: str | None
    setup: str
    controller: str | None
    seconds: float
    apply: str | None = None
    value: float = 0.0


@dataclass(frozen=True, eq=False)
class Problem:
    """What is to be measured in one case. `start` is the state as plain JSON, `xml_as_written` the model without the
    numbers that were drawn."""

    claims: tuple[Claim, ...]
    axis: Axis | None
    seconds: float
    xml: str
    start: Mapping[str, Any]
    x: tuple[float, ...]
    xml_as_written: str

    def list_experiments(self, claim: Claim) -> tuple[Experiment, ...]:
        """Returns the runs of a claim: one for each x of a curve whose axis has `apply`, else one."""
        setup = ";\n".join(filter(None, (*write_start(self.start), claim.setup)))
        seconds = claim.seconds or self.seconds
        base = (self.xml, self.start["key"], setup, claim.controller, seconds)
        if claim.form == "curve" and self.axis is not None and self.axis.apply is not None:
            return tuple(Experiment(*base, self.axis.apply, value) for value in self.x)
        return (Experiment(*base),)

    def count_values(self, claim: Claim) -> int:
        """Returns how many numbers a claim has: two of an interval."""
        return {"number": 1, "interval": 2, "curve": len(self.x)}[claim.form]

    def inputs(self) -> dict[str, Any]:
        """Returns what the driver gets: the model, the start, x, and the names. Nothing that is measured."""
        asked = [[claim.name, claim.form] for claim in self.claims]
        return {
            "model": self.xml,
            "start": dict(self.start),
            "x": None if self.axis is None else list(self.x),
            "claims": asked,
        }


def write_start(start: Mapping[str, Any]) -> Iterator[str]:
    """Yields the statements that write the parts of a start which replace those of its keyframe."""
    for part in STATE_PARTS:
        yield from (f"data.{part}[{index}] = {value!r}" for index, value in enumerate(start[part] or ()))


@lru_cache(maxsize=32)
def compile_text(xml: str) -> mujoco.MjModel:
    """Returns the model of an MJCF text. Raises ValueError."""
    return mujoco.MjModel.from_xml_string(xml)


def pose_case(parameters: ClaimsParameters, drawn: DrawnCase[ClaimsCase]) -> Problem:
    """Draws the start and the x of a case. Raises WrongParameter, ValueError and KeyError."""
    case = drawn.case
    check_curves(parameters, case)
    names = [claim.name for claim in parameters.claims]
    if len({*names}) < len(names):
        raise WrongParameter("claims", "two claims have one name: give each its own")
    start = case.start.draw(drawn.rng)
    x = tuple(draw_number(value, drawn.rng) for value in case.x)
    check_start(compile_text(drawn.xml), start)
    return Problem(parameters.claims, parameters.x, parameters.seconds, drawn.xml, start, x, drawn.xml_as_written)


def check_curves(parameters: ClaimsParameters, case: ClaimsCase) -> None:
    """Raises ValueError where curves have no x, or x no curve."""
    curves = [claim for claim in parameters.claims if claim.form == "curve"]
    if bool(curves) != (parameters.x is not None):
        raise WrongParameter("x", "give `x`, the axis of curves, where a claim is a curve, and only there")
    if bool(curves) != bool(case.x):
        raise ValueError("give `x`, the values at which curves are measured, where a claim is a curve, and only there")
    if parameters.x is None:
        return
    over_time = parameters.x.apply is None
    if wrong := [claim.name for claim in curves if (claim.quantity == "trace") != over_time]:
        cure = "x without `apply` is the time of a trace; every other quantity needs `apply`, a statement over `value`"
        raise WrongParameter("x.apply", f"{wrong[0]} is measured otherwise: {cure}")


def check_start(model: mujoco.MjModel, start: Mapping[str, Any]) -> None:
    """Raises ValueError or KeyError where the model has no such keyframe, or a part of the state another size."""
    if start["key"] is not None:
        model.key(start["key"])
    sizes = {"qpos": model.nq, "qvel": model.nv, "act": model.na, "ctrl": model.nu}
    for part, size in sizes.items():
        if start[part] is not None and len(start[part]) != size:
            raise ValueError(f"start.{part} has {len(start[part])} numbers, and the model {size}")
