"""The parameters of every exercise, as authors write them in JSON; writes a case's numbers into its model."""

import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Annotated, Any, TypeVar

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, field_validator
from pydantic_core import PydanticCustomError

from grader.domain.numbers import Points, Positive, Range, Value, WholeRange

SIZING = {"replicate", "composite", "flexcomp", "size", "lengthrange", "hfield", "mesh", "texture"}
"""Elements of which drawn numbers might make a model that is too large to compile."""

CASES_MAX = 50
"""Most cases of an exercise: each is a run in the jail, and a finding that a learner reads."""


class Strict(BaseModel):
    """Frozen; an unknown key is an error. Keys that begin with `x-` are removed before validation."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, defer_build=True)


class Number(Strict):
    """A number of a model and its position in the MJCF. `element` is an ElementTree path below the root, such as
    `position[@name='servo']` or `body[@name='pendulum']/inertial`; `text` is the attribute's value, with `{}` for the
    number."""

    element: str = Field(min_length=1)
    attribute: str = Field(min_length=1)
    text: str = Field(default="{}", pattern=r"^[^{}]*\{\}[^{}]*$")


class Case(Strict):
    """The keys of every case. Students see neither title nor numbers of a hidden case. `model` (a name in models/) or
    `xml` (MJCF text) replaces the exercise's model. `hint` is the diagnosis when this is the first case that fails and
    no mistake is recognised."""

    id: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$")
    title: str | None = None
    hidden: bool = False
    points: Points = 1.0
    model: str | None = None
    xml: str | tuple[str, ...] | None = None
    set: dict[str, Value] = Field(default_factory=dict)
    hint: str | None = None


ELEMENTS_MAX = 10_000
"""Most numbers of an array, or of a part of the state."""

Values = Annotated[tuple[Value, ...], Field(max_length=ELEMENTS_MAX)]


class Start(Strict):
    """The state in which `data` is given: a keyframe, and parts that replace its own."""

    key: str | None = None
    qpos: Values | None = None
    qvel: Values | None = None
    act: Values | None = None
    ctrl: Values | None = None

    def draw(self, rng: np.random.Generator) -> dict[str, Any]:
        """Returns the state as plain JSON: the name of the keyframe, and the numbers of each part or None."""
        parts = {name: getattr(self, name) for name in STATE_PARTS}
        drawn = {
            name: None if values is None else [draw_exactly(value, rng) for value in values]
            for name, values in parts.items()
        }
        return {"key": self.key, **drawn}


STATE_PARTS = ("qpos", "qvel", "act", "ctrl")


class WrongProgram(Strict):
    """A program that makes a mistake, by its path in the content folder, and the sentence for a student whose script
    does the same."""

    program: str = Field(min_length=1)
    sentence: str = Field(min_length=1)


class ExerciseParameters(Strict):
    """The keys of every exercise's `check` beside its `kind`; a kind adds its own in a subclass. `luck` is the largest
    chance at which one fixed answer may be right in every case; docs/authoring.md says more. Each of the `mistakes` is
    a script like a student's: where no earlier one fits, it runs in the jail for every wrong script."""

    model: str | None = None
    numbers: dict[str, Number] = Field(default_factory=dict)
    luck: Positive = Field(default=1e-6, le=1)
    mistakes: tuple[WrongProgram, ...] = Field(default=(), max_length=8)
    cases: tuple[Case, ...] = Field(min_length=1, max_length=CASES_MAX)

    @field_validator("cases")
    @classmethod
    def check_cases(cls, cases: tuple[Case, ...]) -> tuple[Case, ...]:
        """Returns the cases. Raises PydanticCustomError where a kind that declares its own has none or too many."""
        if not 1 <= len(cases) <= CASES_MAX:
            raise PydanticCustomError("cases", "must have 1 to {most} cases", {"most": CASES_MAX})
        return cases


def name_cases(cases: Sequence[Case]) -> dict[str, str]:
    """Returns what cases are called in the ids of findings, by their own ids: a hidden one is counted, since its own id
    may tell of it."""
    hidden = [case.id for case in cases if case.hidden]
    return {case.id: f"hidden-{hidden.index(case.id) + 1}" if case.hidden else case.id for case in cases}


class WrongParameter(ValueError):
    """A parameter that cannot work. `key` is its place below `check`, such as `start` or `numbers.kp.element`."""

    def __init__(self, key: str, why: str) -> None:
        super().__init__(why)
        self.key = key


class WrongParameters(ValueError):
    """Several parameters that cannot work, each for itself."""

    def __init__(self, errors: Sequence[WrongParameter]) -> None:
        super().__init__("; ".join(map(str, errors)))
        self.errors = errors


class WrongInCase(ValueError):
    """A key of a case that cannot work, such as `arguments`."""

    def __init__(self, key: str, why: str) -> None:
        super().__init__(why)
        self.key_in_case = key


AnyCase = TypeVar("AnyCase", bound=Case)


def list_keys(model: type[BaseModel]) -> set[str]:
    """Returns the keys of the parameters and of every part of them."""
    schema = model.model_json_schema()
    return {name for part in (schema, *schema.get("$defs", {}).values()) for name in part.get("properties", ())}


def list_ends(case: AnyCase) -> tuple[AnyCase, ...]:
    """Returns the case with every range at its lower end, and with every range at its upper end; one if they agree."""
    low, high = (take_end(case, end) for end in (0, 1))
    return (low,) if low == high else (low, high)


def take_end(part: Any, end: int) -> Any:
    """Returns a part of the parameters with this end in place of every range, at any depth."""
    if isinstance(part, Range | WholeRange):
        return part[end]
    if isinstance(part, BaseModel):
        return part.model_copy(update={name: take_end(value, end) for name, value in part})
    if isinstance(part, dict):
        return {name: take_end(value, end) for name, value in part.items()}
    return tuple(take_end(value, end) for value in part) if isinstance(part, tuple) else part


def draw_number(value: Value, rng: np.random.Generator) -> float:
    """Returns a number unchanged, or one drawn from its range and rounded to four figures."""
    return float(f"{rng.uniform(*value):.4g}") if isinstance(value, tuple) else value


def draw_exactly(value: Value, rng: np.random.Generator) -> float:
    """Returns a number unchanged, or draws one from its range: in full precision, so that no value is likely."""
    return float(rng.uniform(*value)) if isinstance(value, tuple) else value


def write_numbers(xml: str, numbers: Mapping[str, Number], values: Mapping[str, float]) -> str:
    """Writes `values` into the MJCF text `xml`. Raises WrongParameter if a number's `element` is not a path, or
    the model has no such element, and ValueError if the text is not XML."""
    return _write_numbers(xml, tuple((name, numbers[name], value) for name, value in values.items()))


@lru_cache(maxsize=64)
def _write_numbers(xml: str, written: tuple[tuple[str, Number, float], ...]) -> str:
    try:
        root = ET.fromstring(xml)  # noqa: S314 - the author's own file
    except ET.ParseError as error:
        raise ValueError(f"the model is not XML: {error}") from error
    for name, number, value in written:
        elements = find_elements(root, name, number)
        if not elements:
            raise WrongParameter(
                f"numbers.{name}.element", f"the model has no element {number.element}: correct the path"
            )
        if fixed := next((element.tag for element in elements if element.tag in SIZING), None):
            why = f"a number may not change a <{fixed}>, which decides how large the model is: write a case for each"
            raise WrongParameter(f"numbers.{name}.element", why)
        for element in elements:
            element.set(number.attribute, number.text.format(repr(float(value))))
    return ET.tostring(root, encoding="unicode")


def find_elements(root: ET.Element, name: str, number: Number) -> list[ET.Element]:
    """Returns the elements that hold a number. Raises WrongParameter where `element` is not a path."""
    try:
        return root.findall(f".//{number.element}")
    except (SyntaxError, KeyError, TypeError, ValueError) as error:
        why = f"{number.element!r} is not a path: write it like body[@name='arm']/inertial"
        raise WrongParameter(f"numbers.{name}.element", why) from error
