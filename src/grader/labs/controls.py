"""Control values: what a learner may set, and what the author's own values must satisfy."""

from collections.abc import Iterator, Mapping
from math import isfinite

from grader.domain.lab import Button, LabConfig, OptionValue, Select, Slider
from grader.errors import Fault, LabRefused
from grader.expressions import Value, texts, values

Wish = float | str | bool
STEP_TOLERANCE = 1e-6
"""How far off the grid of a slider a value may be, in steps: decimal steps are not exact in binary."""


def list_settable(config: LabConfig) -> list[Slider | Select]:
    """Returns the controls that have a value."""
    return [control for control in config.controls if not isinstance(control, Button)]


def choose_values(config: LabConfig, wishes: Mapping[str, Wish]) -> dict[str, OptionValue]:
    """Returns the value of every slider and select by label: the learner's where given, else the author's. Raises
    LabRefused naming the control and its range, step or options."""
    controls = {control.label: control for control in list_settable(config)}
    for label in wishes:
        if label not in controls:
            known = ", ".join(controls) or "none"
            raise LabRefused(f"There is no control {label[:80]!r} here; the controls are: {known}.")
    return {
        label: _check_value(control, wishes[label]) if label in wishes else _get_default(control)
        for label, control in controls.items()
    }


def _get_default(control: Slider | Select) -> OptionValue:
    """Says where the author put the control; the first option where that is not said."""
    default = control.options[0][1] if isinstance(control, Select) else control.value
    return default if control.value is None else control.value


def list_extremes(control: Slider | Select) -> list[Wish]:
    """Returns the ends of a slider, all options of a select."""
    if isinstance(control, Slider):
        return [control.min, control.max]
    return [text for text, _ in control.options]


def _check_value(control: Slider | Select, wish: Wish) -> OptionValue:
    if isinstance(control, Select):
        for text, value in control.options:
            if wish == text or (wish == value and isinstance(wish, bool) == isinstance(value, bool)):
                return value
        options = ", ".join(text for text, _ in control.options)
        raise LabRefused(f"{control.label} must be one of: {options}.")
    text = f"{control.label} must be a number from {_format(control.min)} to {_format(control.max)}"
    if isinstance(wish, bool) or not isinstance(wish, int | float) or not control.min <= wish <= control.max:
        raise LabRefused(f"{text}.")
    steps = (wish - control.min) / control.step if control.step is not None else 0.0
    if abs(steps - round(steps)) > STEP_TOLERANCE and wish not in (control.value, control.max):
        raise LabRefused(f"{text}, in steps of {_format(control.step or 0)}.")
    return float(wish)


def _format(number: float) -> str:
    return texts.number_to_string(float(number))


def to_value(option: OptionValue) -> Value:
    """Returns an author's value as the language has it."""
    if isinstance(option, tuple):
        return [float(x) for x in option]
    if isinstance(option, bool):
        return option
    return values.to_units(option) if isinstance(option, str) else float(option)


def find_control_faults(config: LabConfig, where: str) -> Iterator[Fault]:
    """Says what is wrong with the controls themselves."""
    seen: set[str] = set()
    for i, control in enumerate(config.controls):
        place = f"{where}.controls.{i}"
        if control.label in seen:
            yield Fault("", f"{place}.label", f"two controls are called {control.label!r}: give each its own label")
        seen.add(control.label)
        if isinstance(control, Slider):
            numbers = (control.min, control.max, control.step or 1.0, control.value)
            if not all(map(isfinite, numbers)) or not control.min < control.max:
                yield Fault("", f"{place}.min", "min must be below max")
            elif not control.min <= control.value <= control.max:
                yield Fault("", f"{place}.value", f"{control.value:g} is outside {control.min:g}..{control.max:g}")
        elif isinstance(control, Select) and control.value not in (None, *(value for _, value in control.options)):
            yield Fault("", f"{place}.value", f"{control.value!r} is the value of no option")
