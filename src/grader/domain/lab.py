"""The lab configs that authors write: `sim` of a predict question, and what all labs of a lesson have."""

from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag, model_validator

from grader.domain.numbers import Positive, Real

CONTROLS_MAX = 40
"""Most controls of a lab: each is tried at both ends when content is loaded."""

OPTIONS_MAX = 40
"""Most options of a select: each is tried when content is loaded."""

SHOWN_MAX = 40
"""Most readouts, plots, traces and reference lines in one list: each is computed in every frame."""

SECONDS_MAX = 60.0
"""The longest run of a lab [s]."""

Expression = str
"""An expression or statement in a small subset of JavaScript; it is compiled when content is loaded."""


class LabPart(BaseModel):
    """Base of the models in this module: frozen, unknown keys are errors."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class Slider(LabPart):
    """A number that the learner sets: written to a path (`set`), by a statement (`apply`) or to `ctx` (`param`). With
    `init` it is written again after `setup`, because it sets state that `setup` or a reset overwrites. Without a `step`
    it takes every value of its range."""

    type: Literal["slider"] = "slider"
    label: str
    unit: str | None = None
    set: str | None = None
    apply: Expression | None = None
    param: str | None = None
    min: Real
    max: Real
    step: Positive | None = None
    value: Real
    digits: int | None = Field(default=None, ge=0, le=12)
    reset: bool = False
    init: bool = False


OptionValue = Real | bool | str | tuple[Real, ...]


class Select(LabPart):
    """A choice between labelled values; `value` defaults to the first."""

    type: Literal["select"]
    label: str
    unit: str | None = None
    set: str | None = None
    apply: Expression | None = None
    param: str | None = None
    options: tuple[tuple[str, OptionValue], ...] = Field(min_length=1, max_length=OPTIONS_MAX)
    value: OptionValue | None = None
    reset: bool = False
    init: bool = False


class Button(LabPart):
    """A statement that runs when the learner presses it: a timed event."""

    type: Literal["button"]
    label: str
    run: Expression


def _control_type(control: Any) -> str:
    """The type of a control; sliders are written without one."""
    return str(control.get("type", "slider") if isinstance(control, dict) else getattr(control, "type", "slider"))


Control = Annotated[
    Annotated[Slider, Tag("slider")] | Annotated[Select, Tag("select")] | Annotated[Button, Tag("button")],
    Discriminator(_control_type),
]


class Readout(LabPart):
    """A labelled number or text under the view."""

    label: str
    expr: Expression
    digits: int | None = Field(default=None, ge=0, le=12)
    unit: str | None = None


class PlotTrace(LabPart):
    """One line of a plot."""

    label: str
    expr: Expression
    dash: bool | tuple[Real, ...] | None = None
    color: str | None = None


Height = Annotated[Real, Field(gt=0, le=5000)]
"""Of a picture on the page [px]."""


class Plot(LabPart):
    """Traces against time."""

    xlabel: str | None = None
    ylabel: str | None = None
    height: Height | None = None
    window: Positive | None = None
    ymin: Real | None = None
    ymax: Real | None = None
    refLines: tuple[Any, ...] = Field(default=(), max_length=SHOWN_MAX)
    traces: tuple[PlotTrace, ...] = Field(min_length=1, max_length=SHOWN_MAX)

    @model_validator(mode="after")
    def _has_a_height(self) -> Self:
        if self.ymin is not None and self.ymax is not None and self.ymin >= self.ymax:
            raise ValueError(f"ymin must be below ymax, not {self.ymin:g} and {self.ymax:g}")
        return self


OVERLAYS = ("frames", "joints", "contacts", "forces", "com", "sites", "cameras", "shadows")
"""What can be drawn over the scene; `com` are the bodies' centres of mass."""


Seconds = Annotated[Positive, Field(le=SECONDS_MAX)]


class LabConfig(LabPart):
    """One simulation with its controls, readouts and plots. `seconds` is the length of a run; `forceScale` the length
    of a contact force's arrow [m/N]. `overlays` says what is drawn at first, `toggles` what the learner may turn on and
    off."""

    title: str | None = None
    model: str | None = None
    xml: str | None = None
    key: int | str | None = None
    setup: Expression | None = None
    controls: tuple[Control, ...] = Field(default=(), max_length=CONTROLS_MAX)
    controller: Expression | None = None
    readouts: tuple[Readout, ...] = Field(default=(), max_length=SHOWN_MAX)
    plots: tuple[Plot, ...] = Field(default=(), max_length=SHOWN_MAX)
    trail: Any = None
    camera: dict[str, Any] | None = None
    overlays: dict[str, bool] | tuple[str, ...] | None = None
    toggles: tuple[str, ...] | None = None
    forceScale: Positive | None = None
    seconds: Seconds | None = None
    stopAt: Positive | Expression | None = None
    autoplay: bool = False
    note: str | None = None
    height: Height | None = None
    dock: bool = False

    @property
    def over_the_scene(self) -> tuple[str, ...]:
        """Every overlay that the lab names: drawn at first, or offered to the learner."""
        return tuple(dict.fromkeys((*(self.overlays or ()), *(self.toggles or ()))))


class Lab(LabPart):
    """What every lab of a lesson has. A kind of lab derives its own model, which narrows `kind` to its names. `note` is
    HTML below the lab. `dock` is a key of the course's own page and changes nothing here."""

    id: str
    kind: str
    title: str | None = None
    note: str | None = None
    dock: bool = False


class SimLab(LabConfig, Lab):
    """A lab of a lesson that runs one scene."""

    kind: Literal["simlab"] = "simlab"


class UnknownLab(LabPart):
    """A lab of a kind that this service does not have: the page shows a placeholder, and the author gets a remark."""

    model_config = ConfigDict(frozen=True, extra="allow")

    id: str
    kind: str
    title: str | None = None
