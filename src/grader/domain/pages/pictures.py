"""The shapes of what kinds of exercise ask pages to draw: charts, tables, the box of a film."""

from collections.abc import Iterator
from functools import cache
from typing import Any, Self

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError, model_validator

from grader.domain.misread import explain_misread


class Part(BaseModel):
    """Frozen; further keys are ignored."""

    model_config = ConfigDict(frozen=True, extra="ignore", defer_build=True)


class ChartAxis(Part):
    """The axis of a chart that a kind of exercise asks for."""

    label: str = ""
    log: bool = False
    min: float | None = None
    max: float | None = None


class Series(Part):
    """One line of such a chart."""

    label: str = ""
    x: list[float | None]
    y: list[float | None]


class Mark(Part):
    """A marked value on one axis of such a chart."""

    x: float | None = None
    y: float | None = None
    label: str = ""


class Chart(Part):
    """A line chart that a kind of exercise asks for."""

    case: str
    title: str = ""
    x: ChartAxis = ChartAxis()
    y: ChartAxis = ChartAxis()
    series: list[Series]
    marks: list[Mark] = []


class OwnFilm(Part):
    """What the box of the films says that a kind of exercise records of the learner's own runs."""

    title: str
    about: str = ""


class Table(Part):
    """A table that a kind of exercise asks for: texts, a row of headings and rows of as many cells."""

    case: str
    title: str = ""
    head: list[str] = Field(min_length=1, max_length=12)
    rows: list[list[str]] = Field(max_length=100)

    @model_validator(mode="after")
    def _has_whole_rows(self) -> Self:
        if any(len(row) != len(self.head) for row in self.rows):
            raise ValueError("a row has more or fewer cells than there are headings")
        return self


SHAPES: dict[str, Any] = {"charts": list[Chart] | None, "motions": list[Chart] | None, "tables": list[Table] | None,
          "film": OwnFilm | None}  # fmt: skip
"""What pages draw of the evidence of any kind, by its key."""


@cache
def build_reader(shape: Any) -> TypeAdapter[Any]:
    """Returns what validates values of a shape, built once: building takes a hundred times as long as reading."""
    return TypeAdapter(shape)


def find_wrong_pictures(evidence: Any) -> Iterator[tuple[str, str]]:
    """Yields the key of each part of an evidence that no page can draw, with the first reason; "" for one that is no
    object."""
    if not isinstance(evidence, dict):
        yield "", f"must be an object, not {type(evidence).__name__}"
        return
    for key, shape in SHAPES.items():
        try:
            build_reader(shape).validate_python(evidence.get(key))
        except ValidationError as error:
            place, why = next(explain_misread(error, evidence[key], lambda _: ()))
            yield key, f"{'.'.join(map(str, (key, *place)))}: {why}"
