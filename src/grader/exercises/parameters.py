"""The parameters of an exercise, as an author writes them in JSON, and how a case's numbers get into its model."""

import re
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Iterator, Mapping, Sequence
from difflib import get_close_matches
from typing import Any, TypeVar

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic_core import ErrorDetails


class Strict(BaseModel):
    """Frozen; an unknown key is an error. Keys that begin with `x-` are removed before validation."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


Range = tuple[float, float]
Value = float | Range
"""A number, or a range from which each submission's seed draws one."""


class Number(Strict):
    """A number of a model and its position in the MJCF.

    `element` is an ElementTree path below the root, such as `position[@name='servo']` or
    `body[@name='pendulum']/inertial`; `text` is the attribute's value, with `{}` for the number.
    """

    element: str = Field(min_length=1)
    attribute: str = Field(min_length=1)
    text: str = Field(default="{}", pattern=r"^[^{}]*\{\}[^{}]*$")


class Case(Strict):
    """What every case has. Students see neither title nor numbers of a hidden one.

    `model` (a name in models/) or `xml` (MJCF text) replaces the exercise's model. `hint` is the diagnosis when this is
    the first case that fails and no mistake is recognised.
    """

    id: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$")
    title: str | None = None
    hidden: bool = False
    points: float = Field(default=1.0, gt=0)
    model: str | None = None
    xml: str | tuple[str, ...] | None = None
    set: dict[str, Value] = Field(default_factory=dict)
    hint: str | None = None


class ExerciseParameters(Strict):
    """What the `check` of every exercise has beside its `kind`; a kind adds its own fields in a subclass.

    `luck` is the largest chance at which one fixed answer may be right in every case; docs/authoring.md says more.
    """

    model: str | None = None
    numbers: dict[str, Number] = Field(default_factory=dict)
    luck: float = Field(default=1e-6, gt=0, le=1)
    cases: tuple[Case, ...] = Field(min_length=1)


class WrongParameter(ValueError):
    """A parameter that cannot work; `key` is its place below `check`, such as `start` or `numbers.kp.element`."""

    def __init__(self, key: str, why: str) -> None:
        super().__init__(why)
        self.key = key


AnyCase = TypeVar("AnyCase", bound=Case)


def without_remarks(value: Any) -> Any:
    """Returns a JSON value without its `x-` keys, at any depth."""
    if isinstance(value, Mapping):
        return {key: without_remarks(item) for key, item in value.items() if not str(key).startswith("x-")}
    if isinstance(value, list | tuple):
        return [without_remarks(item) for item in value]
    return value


def misread_parameters(
    model: type[BaseModel], raw: Mapping[str, Any], error: ValidationError
) -> Iterator[tuple[str, str]]:
    """Yields key and reason of every parameter that pydantic refused, one reason for each key.

    A list is called too short also when its items are faulty: that is left out.
    """
    schema = model.model_json_schema()
    known = {name for part in (schema, *schema.get("$defs", {}).values()) for name in part.get("properties", ())}
    places = {tuple(detail["loc"]) for detail in error.errors()}
    told: set[str] = set()
    for detail in error.errors():
        loc = detail["loc"]
        if detail["type"] == "too_short" and any(place != loc and place[: len(loc)] == loc for place in places):
            continue
        key = ".".join(map(str, place_in(raw, loc, is_missing=detail["type"] == "missing")))
        if key not in told:
            told.add(key)
            yield key, reason_of(detail, known)


def place_in(raw: Any, loc: Sequence[str | int], *, is_missing: bool) -> Iterator[str | int]:
    """Yields the steps of pydantic's location that are keys or indices of the JSON, not names of types."""
    for step in loc:
        inside = raw if isinstance(raw, Mapping) else range(len(raw)) if isinstance(raw, list | tuple) else ()
        if step in inside:
            raw = raw[step]
            yield step
        elif is_missing and step == loc[-1]:
            yield step


def reason_of(detail: ErrorDetails, known: Iterable[str]) -> str:
    """Returns what is wrong with a parameter, and the cure."""
    if detail["type"] == "missing":
        return "is missing: add it"
    if detail["type"] == "extra_forbidden":
        near = get_close_matches(str(detail["loc"][-1]), known, n=1)
        return f"unknown key: {f'write {near[0]!r}, or ' if near else ''}remove it, or begin it with x-"
    why = re.sub(r"^(Input|String|Tuple|List|Dictionary) should", "must", detail["msg"]).removeprefix("Value error, ")
    given = detail["input"]
    return f"{why}, not {given!r}"[:300] if isinstance(given, int | float | str | None) else why


def ends(case: AnyCase) -> tuple[AnyCase, ...]:
    """Returns the case with every range at its lower end, and with every range at its upper end."""
    sets = (
        {name: value[end] if isinstance(value, tuple) else value for name, value in case.set.items()} for end in (0, 1)
    )
    return tuple(case.model_copy(update={"set": values}) for values in sets)


def drawn(value: Value, rng: np.random.Generator) -> float:
    """Returns a number unchanged, or one drawn from its range and rounded to four figures."""
    if not isinstance(value, tuple):
        return value
    return float(f"{rng.uniform(*value):.4g}")


def with_numbers(xml: str, numbers: Mapping[str, Number], values: Mapping[str, float]) -> str:
    """Writes `values` into the MJCF text `xml`.

    Raises:
        WrongParameter: a number's `element` is no path, or the model has no such element.
        ValueError: the text is not XML.
    """
    try:
        root = ET.fromstring(xml)  # noqa: S314 - the author's own file
    except ET.ParseError as error:
        raise ValueError(f"the model is not XML: {error}") from error
    for name, value in values.items():
        number = numbers[name]
        found = elements(root, name, number)
        if not found:
            raise WrongParameter(f"numbers.{name}.element", f"the model has no element {number.element}")
        for element in found:
            element.set(number.attribute, number.text.format(repr(float(value))))
    return ET.tostring(root, encoding="unicode")


def elements(root: ET.Element, name: str, number: Number) -> list[ET.Element]:
    """Returns the elements that hold a number. Raises WrongParameter where `element` is no path."""
    try:
        return root.findall(f".//{number.element}")
    except (SyntaxError, KeyError, TypeError, ValueError) as error:
        why = f"{number.element!r} is no path; write it like body[@name='arm']/inertial"
        raise WrongParameter(f"numbers.{name}.element", why) from error
