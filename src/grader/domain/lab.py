"""The lab configs that authors write: `sim` of a predict question, and the labs of a lesson."""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag

Expression = str
"""An expression or statement in a small subset of JavaScript; it is compiled when content is loaded."""


class LabPart(BaseModel):
    """Base of the models in this module: frozen, unknown keys are errors."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class Slider(LabPart):
    """A number that the learner sets: written to a path (`set`), by a statement (`apply`) or to `ctx` (`param`).

    With `init` it is written again after `setup`, because it sets state that `setup` or a reset overwrites.
    """

    type: Literal["slider"] = "slider"
    label: str
    unit: str | None = None
    set: str | None = None
    apply: Expression | None = None
    param: str | None = None
    min: float
    max: float
    step: float = Field(gt=0)
    value: float
    digits: int | None = Field(default=None, ge=0, le=12)
    reset: bool = False
    init: bool = False


OptionValue = float | bool | str | tuple[float, ...]


class Select(LabPart):
    """A choice between labelled values; `value` defaults to the first."""

    type: Literal["select"]
    label: str
    unit: str | None = None
    set: str | None = None
    apply: Expression | None = None
    param: str | None = None
    options: tuple[tuple[str, OptionValue], ...] = Field(min_length=1)
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
    dash: bool | tuple[float, ...] | None = None
    color: str | None = None


class Plot(LabPart):
    """Traces against time."""

    ylabel: str | None = None
    window: float | None = Field(default=None, gt=0)
    ymin: float | None = None
    ymax: float | None = None
    refLines: tuple[Any, ...] = ()
    traces: tuple[PlotTrace, ...] = Field(min_length=1)


class LabConfig(LabPart):
    """One simulation with its controls, readouts and plots."""

    title: str | None = None
    model: str | None = None
    xml: str | None = None
    key: int | str | None = None
    setup: Expression | None = None
    controls: tuple[Control, ...] = ()
    controller: Expression | None = None
    readouts: tuple[Readout, ...] = ()
    plots: tuple[Plot, ...] = ()
    trail: Any = None
    camera: dict[str, Any] | None = None
    overlays: Any = None
    toggles: Any = None
    stopAt: float | Expression | None = None
    autoplay: bool = False
    note: str | None = None
    height: float | None = None
    dock: bool = False


class SimLab(LabConfig):
    """A lab of a lesson that runs one scene."""

    id: str
    kind: Literal["simlab"]


class IntegratorsLab(LabPart):
    """A lab of a lesson that runs one scene under all five integrators from one state."""

    id: str
    kind: Literal["integrators"]
    title: str | None = None
    model: str
    models: tuple[str, ...] = ()
    key: int | str | None = None
    timestep: float = Field(default=0.002, gt=0)
    seconds: float = Field(default=20.0, gt=0, le=60)
    dock: bool = False


Lab = Annotated[SimLab | IntegratorsLab, Field(discriminator="kind")]
