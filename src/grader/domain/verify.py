"""`verify`: how the key of a question is derived again."""

from typing import Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from grader.domain.lab import Expression

Setting = dict[str, float | bool | str]
"""Control values of the question's lab, by label."""

When = Literal["end", "always", "ever"]
IntegratorName = Literal["Euler", "RK4", "implicit", "implicitfast", "discrete"]


class VerifyPart(BaseModel):
    """Base of the models in this module: frozen, unknown keys are errors."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class Claim(VerifyPart):
    """A claim about the history of a run, read at every step from `since` to `until` [s] (both included).

    `expr` is true at the `end` of that window, `always` or `ever` in it; or a number that is counted or measured lies
    between `at_least` and `at_most`: how many `times` the expression becomes true (a start at which it is true counts
    not), the `first` time [s] at which it is true, or its largest (`max`) or smallest (`min`) value.
    """

    expr: Expression
    when: Literal["end", "always", "ever", "times", "first", "max", "min"] = "end"
    at_least: float | None = None
    at_most: float | None = None
    since: float = Field(default=0.0, ge=0)
    until: float | None = Field(default=None, gt=0)

    @model_validator(mode="after")
    def _bounds_fit(self) -> Self:
        bounded = self.at_least is not None or self.at_most is not None
        if bounded != (self.when in ("times", "first", "max", "min")):
            raise ValueError("give at_least or at_most with times, first, max and min, and only with these")
        if self.until is not None and self.until <= self.since:
            raise ValueError("until must be later than since")
        return self


class ByOptions(VerifyPart):
    """Run the lab of a predict question under each option's setting; `criterion` holds for the right option only.

    `criterion` is `stable` (no warning over the run), an expression that is true at the `end`, `always` or `ever`, or
    a Claim. `settings` has one entry per option, null for an option such as "None of them"; by default the options are
    labels of a select of the lab.
    """

    by: Literal["options"]
    settings: tuple[Setting | None, ...] | None = None
    criterion: Expression | Claim = "stable"
    when: When = "end"
    seconds: float | None = Field(default=None, gt=0, le=60)


class ByOutcome(VerifyPart):
    """Run the lab of a predict question once; of the `claims`, one per option, only the right one is true.

    A claim is an expression, true at `when`, or a Claim.
    """

    by: Literal["outcome"]
    claims: tuple[Expression | Claim, ...] = Field(min_length=2)
    controls: Setting = {}
    when: When = "end"
    seconds: float | None = Field(default=None, gt=0, le=60)


class ByStage(VerifyPart):
    """Find the stage of mj_step that first fills the field `fills` (`contact`, or an array of mjData).

    `stages` has the call of each option, such as mj_fwdPosition; by default it is inferred from the option's words.
    """

    by: Literal["stage"]
    fills: str = "contact"
    model: str | None = None
    xml: str | None = None
    stages: tuple[str | None, ...] | None = None


class ServoJoint(VerifyPart):
    """A joint of inertia [kg m2] held at 0 by a servo with gains kp [N m/rad] and kv [N m s/rad], without gravity."""

    inertia: float = Field(gt=0)
    kp: float = Field(default=0.0, ge=0)
    kv: float = Field(default=0.0, ge=0)


class ByThreshold(VerifyPart):
    """Derive the largest stable timestep of a numeric question between `low` and `high` [s].

    The criterion `decays` takes the linear stability limit (spectral radius = 1), `no_warning` the largest timestep
    without a warning within `seconds`; where these are too short to decide, the linear stability limit. The scene is a
    `servo`, or a `model` or `xml` with `key`, `qpos`, `qvel` and fields of the model to `set`. The answer is `scale`
    times the limit in seconds.
    """

    by: Literal["threshold"]
    servo: ServoJoint | None = None
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
    """Measure the value of `expr` for a numeric question: at the end of a run, or its maximum, minimum or mean."""

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
    """Evaluate a closed form for a numeric question, with the fields of `model` or `xml`, if given."""

    by: Literal["expression"]
    expr: Expression
    model: str | None = None
    xml: str | None = None


Verify = Annotated[
    ByOptions | ByOutcome | ByStage | ByThreshold | ByMeasurement | ByExpression, Field(discriminator="by")
]
