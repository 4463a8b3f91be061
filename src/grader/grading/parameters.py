"""The parameters of a check, as an author writes them in JSON: strict, with every mistake told at once."""

from collections.abc import Mapping
from typing import Any, TypeVar

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from grader.domain.quiz import CodeQuestion
from grader.errors import Fault


class Strict(BaseModel):
    """Frozen; an unknown key is an error, unless it begins with `x-`."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


Range = tuple[float, float]
Value = float | Range
"""A number, or a published range from which a hidden case draws one."""

Parameters = TypeVar("Parameters", bound=Strict)


class Case(Strict):
    """What every case of an exercise has. Of a hidden one the student sees neither title nor numbers."""

    id: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$")
    title: str | None = None
    hidden: bool = False
    points: float = Field(default=1.0, gt=0)
    set: dict[str, Value] = Field(default_factory=dict)


AnyCase = TypeVar("AnyCase", bound=Case)


def without_remarks(value: Any) -> Any:
    """A JSON value without its `x-` keys, at any depth."""
    if isinstance(value, Mapping):
        return {key: without_remarks(item) for key, item in value.items() if not str(key).startswith("x-")}
    if isinstance(value, list | tuple):
        return [without_remarks(item) for item in value]
    return value


def read_parameters(kind: type[Parameters], question: CodeQuestion) -> Parameters:
    """The check's parameters. Raises pydantic.ValidationError."""
    return kind.model_validate(without_remarks(question.check.parameters))


def parameter_faults(error: ValidationError, question: CodeQuestion, where: str) -> list[Fault]:
    """Every complaint of pydantic as an author's fault, with the key as it stands in the quiz file.

    A list is called too short also when its items are faulty: that is left out.
    """
    complaints = error.errors()
    places = [complaint["loc"] for complaint in complaints]
    return [
        Fault(where, ".".join(map(str, (question.id, "check", *place))), complaint["msg"])
        for complaint, place in zip(complaints, places, strict=True)
        if complaint["type"] != "too_short" or not any(p != place and p[: len(place)] == place for p in places)
    ]


def case_titles(cases: tuple[Case, ...]) -> tuple[str, ...]:
    """What a student reads: the title of a visible case, a number for a hidden one."""
    hidden = [case.id for case in cases if case.hidden]
    return tuple(f"hidden case {hidden.index(case.id) + 1}" if case.hidden else case.title or case.id for case in cases)


def duplicate_faults(cases: tuple[Case, ...], question: CodeQuestion, where: str) -> list[Fault]:
    """Two cases of one id."""
    ids = [case.id for case in cases]
    return [
        Fault(where, f"{question.id}.check.cases.{index}.id", f"{id_} is there twice; give each case its own id")
        for index, id_ in enumerate(ids)
        if id_ in ids[:index]
    ]


def extremes(case: AnyCase) -> tuple[AnyCase, ...]:
    """The case with every range at its lower end, and at its upper one: what a draw may be, at the least."""
    ends = (
        {name: value[end] if isinstance(value, tuple) else value for name, value in case.set.items()} for end in (0, 1)
    )
    return tuple(case.model_copy(update={"set": values}) for values in ends)


def drawn(value: Value, rng: np.random.Generator) -> float:
    """A number as it stands, or one drawn from its range, rounded to four figures."""
    if not isinstance(value, tuple):
        return value
    return float(f"{rng.uniform(*value):.4g}")
