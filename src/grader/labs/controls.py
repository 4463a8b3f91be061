"""Control values: what a learner may set, and what the author's own values must satisfy."""

from collections.abc import Iterator, Mapping
from math import isfinite

from grader.domain.lab import Button, LabConfig, OptionValue, Select, Slider
from grader.errors import Fault, LabRefused
from grader.expressions import Value, texts, values

Given = float | str | bool
STEP_TOLERANCE = 1e-6
"""How far off the grid of a slider a value may be, in steps: decimal steps are not exact in binary."""


def settable(config: LabConfig) -> list[Slider | Select]:
    """The controls that have a value."""
    return [control for control in config.controls if not isinstance(control, Button)]


def chosen_values(config: LabConfig, given: Mapping[str, Given]) -> dict[str, OptionValue]:
    """The value of every slider and select by label: the learner's where given, else the author's.

    Raises LabRefused naming the control and its range, step or options.
    """
    controls = {control.label: control for control in settable(config)}
    for label in given:
        if label not in controls:
            known = ", ".join(controls) or "none"
            raise LabRefused(f"There is no control {label[:80]!r} here; the controls are: {known}.")
    return {
        label: _checked(control, given[label]) if label in given else _default(control)
        for label, control in controls.items()
    }


def _default(control: Slider | Select) -> OptionValue:
    """Where the author put the control; the first option where that is not said."""
    default = control.options[0][1] if isinstance(control, Select) else control.value
    return default if control.value is None else control.value


def extreme_values(control: Slider | Select) -> list[Given]:
    """The ends of a slider, all options of a select."""
    if isinstance(control, Slider):
        return [control.min, control.max]
    return [text for text, _ in control.options]


def _checked(control: Slider | Select, given: Given) -> OptionValue:
    if isinstance(control, Select):
        for text, value in control.options:
            if given == text or (given == value and isinstance(given, bool) == isinstance(value, bool)):
                return value
        options = ", ".join(text for text, _ in control.options)
        raise LabRefused(f"{control.label} must be one of: {options}.")
    text = f"{control.label} must be a number from {_text(control.min)} to {_text(control.max)}"
    if isinstance(given, bool) or not isinstance(given, int | float) or not control.min <= given <= control.max:
        raise LabRefused(f"{text}.")
    steps = (given - control.min) / control.step if control.step is not None else 0.0
    if abs(steps - round(steps)) > STEP_TOLERANCE and given not in (control.value, control.max):
        raise LabRefused(f"{text}, in steps of {_text(control.step or 0)}.")
    return float(given)


def _text(number: float) -> str:
    return texts.number_to_string(float(number))


def as_value(option: OptionValue) -> Value:
    """An author's value as the language has it."""
    if isinstance(option, tuple):
        return [float(x) for x in option]
    if isinstance(option, bool):
        return option
    return values.in_units(option) if isinstance(option, str) else float(option)


def control_faults(config: LabConfig, where: str) -> Iterator[Fault]:
    """What is wrong with the controls themselves."""
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
