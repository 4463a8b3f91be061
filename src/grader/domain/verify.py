"""`verify`: how the key of a question is derived again."""

from typing import Annotated, Literal, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationInfo, model_validator
from pydantic_core import PydanticCustomError

from grader.domain.lab import CONTROLS_MAX, Expression, Seconds
from grader.domain.numbers import NotNegative, Positive, Real
from grader.domain.quantities import Summary, Window

Setting = Annotated[dict[str, Real | bool | str], Field(max_length=CONTROLS_MAX)]
"""Control values of the question's lab, by label."""

When = Literal["end", "always", "ever"]
IntegratorName = Literal["Euler", "RK4", "implicit", "implicitfast", "discrete"]


class VerifyPart(BaseModel):
    """Base of the models in this module: frozen, unknown keys are errors."""

    model_config = ConfigDict(frozen=True, extra="forbid")


Reason = Annotated[str, Field(min_length=10, max_length=1000)]
"""Why a key holds that simulation cannot tell."""


class Way(VerifyPart):
    """What every way to derive a key has: why the author publishes the key though simulation cannot tell (`accept`)."""

    accept: Reason | None = None

    @model_validator(mode="after")
    def _has_one_scene(self) -> Self:
        named = [name for name in SCENES if getattr(self, name, None) is not None]
        if len(named) > 1:
            raise ValueError(f"give one of {' and '.join(named)}: only one of them would be used")
        return self


SCENES = ("servo", "model", "xml")
"""Keys that name what is simulated."""


class Simulation(Way):
    """What every way that runs a simulation has.

    `timestep` says what the answer is about: the motion, which the run at the model's own timestep must show too
    (`both`); the motion alone (`any`); or the discretisation at the model's own timestep (`given`), where only
    round-off and nudged starts are varied. `fastest` is the fastest rate [1/s] of forces that a controller switches:
    sampling cannot find them.
    """

    timestep: Literal["both", "any", "given"] = "both"
    fastest: Positive | None = None


class Claim(VerifyPart):
    """A claim about the history of a run, read at every step from `since` to `until` [s] (both included). `expr` is
    true at the `end` of that window, `always` or `ever` in it; or a number that is counted or measured lies between
    `at_least` and `at_most`: how many `times` the expression becomes true (a start at which it is true counts not), the
    `first` time [s] at which it is true, or its largest (`max`) or smallest (`min`) value."""

    expr: Expression
    when: Literal["end", "always", "ever", "times", "first", "max", "min"] = "end"
    at_least: Real | None = None
    at_most: Real | None = None
    since: NotNegative = 0.0
    until: Positive | None = None

    @model_validator(mode="after")
    def _bounds_fit(self) -> Self:
        bounded = self.at_least is not None or self.at_most is not None
        if bounded != (self.when in ("times", "first", "max", "min")):
            raise ValueError("give at_least or at_most with times, first, max and min, and only with these")
        if self.at_least is not None and self.at_most is not None and self.at_least > self.at_most:
            raise ValueError(f"at_least must be at most at_most, not {self.at_least:g} and {self.at_most:g}")
        if self.until is not None and self.until <= self.since:
            raise ValueError("until must be later than since")
        return self


STABLE = "stable"
"""The criterion of an option whose run gives no warning."""


class ByOptions(Simulation):
    """Run the lab of a predict question under each option's setting; `criterion` holds for the right option only.
    `criterion` is `stable` (no warning over the run), an expression that is true at the `end`, `always` or `ever`, or a
    Claim. `settings` has one entry per option, null for an option such as "None of them"; by default the options are
    labels of a select of the lab."""

    by: Literal["options"]
    settings: tuple[Setting | None, ...] | None = None
    criterion: Expression | Claim = STABLE
    when: When = "end"
    seconds: Seconds | None = None


class ByOutcome(Simulation):
    """Run the lab of a predict question once; of the `claims`, one per option, only the right one is true. A claim is
    an expression, true at `when`, or a Claim."""

    by: Literal["outcome"]
    claims: tuple[Expression | Claim, ...] = Field(min_length=2)
    controls: Setting = {}
    when: When = "end"
    seconds: Seconds | None = None


class ByStage(Way):
    """Find the stage of mj_step that first fills the field `fills` (`contact`, or an array of mjData). `stages` has the
    call of each option, such as mj_fwdPosition; by default it is inferred from the option's words."""

    by: Literal["stage"]
    fills: str = "contact"
    model: str | None = None
    xml: str | None = None
    stages: tuple[str | None, ...] | None = None


class ServoJoint(VerifyPart):
    """A joint of inertia [kg m2] held at 0 by a servo with gains kp [N m/rad] and kv [N m s/rad], without gravity."""

    inertia: Positive
    kp: NotNegative = 0.0
    kv: NotNegative = 0.0


Timestep = Annotated[float, Field(ge=1e-6, le=10)]

STEPS_MAX = 5_000_000
"""Most steps of a run that looks for warnings: ten seconds of computing for the lesson's servo."""


def check_high(high: float, info: ValidationInfo) -> float:
    """Returns the largest timestep [s] itself. Raises PydanticCustomError where it is not above `low`."""
    low = info.data.get("low", 0.0)
    if high <= low:
        raise PydanticCustomError("high", "must be above low, which is {low}", {"low": f"{low:g}"})
    return high


def check_seconds(seconds: float, info: ValidationInfo) -> float:
    """Returns the length of a run [s] itself. Raises PydanticCustomError where it has too many steps of `low`."""
    most = STEPS_MAX * info.data.get("low", seconds)
    if seconds > most:
        limits = {"most": f"{most:g}", "steps": STEPS_MAX}
        raise PydanticCustomError("seconds", "must be at most {most} ({steps} steps of low)", limits)
    return seconds


class ByThreshold(Way):
    """Derive the largest stable timestep of a numeric question between `low` and `high` [s]. The criterion `decays`
    takes the linear stability limit (spectral radius = 1), `no_warning` the largest timestep without a warning within
    `seconds`; where these are too short to decide, the linear stability limit. The scene is a `servo`, or a `model` or
    `xml` with `key`, `qpos`, `qvel` and fields of the model to `set`. The answer is `scale` times the limit [s]."""

    by: Literal["threshold"]
    servo: ServoJoint | None = None
    model: str | None = None
    xml: str | None = None
    key: int | str | None = None
    qpos: tuple[Real, ...] | None = None
    qvel: tuple[Real, ...] | None = None
    set: dict[str, Real] = {}
    integrator: IntegratorName = "Euler"
    criterion: Literal["decays", "no_warning"] = "decays"
    low: Timestep = 1e-4
    high: Annotated[Timestep, AfterValidator(check_high)] = Field(default=0.2, validate_default=True)
    seconds: Annotated[Positive, AfterValidator(check_seconds)] = Field(default=3.0, le=300, validate_default=True)
    scale: Positive | None = None


class ByMeasurement(Window, Simulation):
    """Measure `expr` for a numeric question: its value at the `end` of a run of `seconds`, or a quantity of its whole
    series, such as its `max` or `period`. Times, frequencies and rates are converted into the unit of the question;
    everything else must be in it."""

    by: Literal["measurement"]
    model: str | None = None
    xml: str | None = None
    key: int | str | None = None
    setup: Expression | None = None
    controller: Expression | None = None
    expr: Expression
    when: Literal["end", Summary] = "end"
    seconds: Seconds

    @model_validator(mode="after")
    def _window_is_used(self) -> Self:
        self.require_used("when", self.when)
        return self


class ByExpression(Way):
    """Evaluate a closed form for a numeric question, with the fields of `model` or `xml`, if given."""

    by: Literal["expression"]
    expr: Expression
    model: str | None = None
    xml: str | None = None


class ByHand(Way):
    """Derive nothing, neither by simulation nor from the words of the question: `accept` says why the key holds."""

    by: Literal["hand"]
    accept: Reason


Verify = Annotated[
    ByOptions | ByOutcome | ByStage | ByThreshold | ByMeasurement | ByExpression | ByHand, Field(discriminator="by")
]
