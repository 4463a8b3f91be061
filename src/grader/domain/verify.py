"""`verify`: how the key of a question is re-derived, as its author writes it."""

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from grader.domain.lab import Expression

Setting = dict[str, float | bool | str]
"""Control values of the question's lab, by label."""

When = Literal["end", "always", "ever"]
IntegratorName = Literal["Euler", "RK4", "implicit", "implicitfast", "discrete"]


class VerifyPart(BaseModel):
    """Frozen, and strict about its keys."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class ByOptions(VerifyPart):
    """A predict question: run the lab under each option's setting; the right option is the one where `criterion` holds.

    `criterion` is `stable` (no warning over the run) or an expression, true at the `end`, `always` or `ever`.
    `settings` has one entry per option, null for an option such as "None of them"; where it is left out, the options
    are labels of a select of the lab.
    """

    by: Literal["options"]
    settings: tuple[Setting | None, ...] | None = None
    criterion: Expression = "stable"
    when: When = "end"
    seconds: float | None = Field(default=None, gt=0, le=60)


class ByOutcome(VerifyPart):
    """A predict question: run the lab once; each option says by an expression what it claims, true at `when`."""

    by: Literal["outcome"]
    claims: tuple[Expression, ...] = Field(min_length=2)
    controls: Setting = {}
    when: When = "end"
    seconds: float | None = Field(default=None, gt=0, le=60)


class ByStage(VerifyPart):
    """A question about mj_step: the stage whose call first fills `fills` (`contact`, or an array of the data).

    `stages` names each option's call, such as mj_fwdPosition; where it is left out, the options' words do.
    """

    by: Literal["stage"]
    fills: str = "contact"
    model: str | None = None
    xml: str | None = None
    stages: tuple[str | None, ...] | None = None


class Servo(VerifyPart):
    """A joint of inertia [kg m2] held at 0 by a servo with gains kp [N m/rad] and kv [N m s/rad], without gravity."""

    inertia: float = Field(gt=0)
    kp: float = Field(default=0.0, ge=0)
    kv: float = Field(default=0.0, ge=0)


class ByThreshold(VerifyPart):
    """A numeric question: the largest timestep at which the scene `decays` (for ever) or raises `no_warning`.

    The scene is a `servo`, or a `model` or `xml` with `key`, `qpos`, `qvel` and fields of the model to `set`. Searched
    between `low` and `high` [s]; `no_warning` within `seconds`. The answer is `scale` times the limit in seconds.
    """

    by: Literal["threshold"]
    servo: Servo | None = None
    model: str | None = None
    xml: str | None = None
    key: int | str | None = None
    qpos: tuple[float, ...] | None = None
    qvel: tuple[float, ...] | None = None
    set: dict[str, float] = {}
    integrator: IntegratorName = "Euler"
    criterion: Literal["decays", "no_warning"] = "decays"
    low: float = Field(default=1e-4, gt=0)
    high: float = Field(default=0.2, gt=0)
    seconds: float = Field(default=3.0, gt=0, le=300)
    scale: float | None = None


class ByMeasurement(VerifyPart):
    """A numeric question: the value of `expr` in a run, at its end, or its largest, smallest or mean value."""

    by: Literal["measurement"]
    model: str | None = None
    xml: str | None = None
    key: int | str | None = None
    setup: Expression | None = None
    controller: Expression | None = None
    expr: Expression
    when: Literal["end", "max", "min", "mean"] = "end"
    seconds: float = Field(gt=0, le=60)


class ByExpression(VerifyPart):
    """A numeric question: a closed form, over the fields of `model` or `xml` where one is named."""

    by: Literal["expression"]
    expr: Expression
    model: str | None = None
    xml: str | None = None


Verify = Annotated[
    ByOptions | ByOutcome | ByStage | ByThreshold | ByMeasurement | ByExpression, Field(discriminator="by")
]
