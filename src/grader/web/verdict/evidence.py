"""The measurements behind a verdict that pages draw: read from its evidence, each kind of them if its shape is right.
Evidence is stored JSON, possibly of an older version, so what cannot be read is left out."""

from collections.abc import Mapping
from typing import Any, TypeVar

from pydantic import BaseModel, Field, ValidationError

from grader.domain.pages.pictures import Part, build_reader


class Run(Part):
    """The motion at one end of a claimed bracket: time [s] and the first coordinate [rad or m]."""

    case: str
    end: str
    timestep_ms: float
    diverged: bool
    time_s: list[float] = Field(min_length=2)
    angle: list[float] = Field(min_length=2)


class Claim(Part):
    """A claimed bracket [ms] under one integrator, on the axis of the search [ms]."""

    case: str
    integrator: str
    search_ms: tuple[float, float]
    horizon_s: float
    claim_ms: tuple[float, float] | None
    said_none: bool


class Motion(Part):
    """Some positions of the learner's own run of a case."""

    case: str


class Limit(Part):
    """The limits of one case and integrator [ms]; None where there is none in the search."""

    case: str
    linear_ms: float | None
    within_ms: float | None
    spring_ms: float | None = None


class Difference(Part):
    """The distance from MuJoCo's RK4 against time [s]."""

    case: str
    tolerance: float = Field(gt=0)
    time_s: list[float]
    qpos: list[float | None]
    qvel: list[float | None]


class Order(Part):
    """The error against the timestep [ms]; None where a run ended early."""

    timestep_ms: list[float] = Field(min_length=2)
    error: list[float | None]
    slope: float | None
    expected_slope: float


class Coefficients(Part):
    """A Butcher tableau as it is written: rows of `a`, `b` and `c`."""

    a: list[list[str]]
    b: list[str]
    c: list[str]


class Tableau(Part):
    """The tableau measured from a step, the one that was asked for, and the cells that differ."""

    given: Coefficients
    asked: Coefficients
    wrong: list[Any] = Field(default_factory=list)


class Geom(Part):
    """A geom of a model: MuJoCo's sizes [m], place [m] and rotation matrix by rows."""

    type: str
    size: tuple[float, float, float]
    at: tuple[float, float, float]
    turned: tuple[float, float, float, float, float, float, float, float, float]


class Model(Part):
    """The geoms of a model where a case begins."""

    case: str
    geoms: list[Geom] = Field(max_length=1000)


class Value(Part):
    """One result of a call: computed and expected."""

    case: str
    call: int
    arguments: list[Any]
    result: str
    unit: str | None = None
    computed: Any = None
    expected: Any = None


Read = TypeVar("Read", bound=BaseModel)


def read_list(evidence: Mapping[str, Any], key: str, kind: type[Read]) -> list[Read]:
    """Returns the list under a key; empty if it is missing or of another shape."""
    try:
        values: list[Read] = build_reader(list[kind]).validate_python(evidence.get(key) or [])  # type: ignore[valid-type]
        return values
    except ValidationError:
        return []


def read_one(evidence: Mapping[str, Any], key: str, kind: type[Read]) -> Read | None:
    """Returns the object under a key; None if it is missing or of another shape."""
    try:
        value: Read | None = build_reader(kind).validate_python(evidence[key]) if evidence.get(key) else None
        return value
    except ValidationError:
        return None
