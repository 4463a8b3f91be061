"""The numbers that authors write: finite, of a size that arithmetic can hold, and ranges in ascending order. A model
that holds numbers takes its types from here, so that each rule and its sentence is written once."""

from typing import Annotated, Any, NamedTuple

from pydantic import AfterValidator, Discriminator, Field, GetCoreSchemaHandler, Tag
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

SIZE_MIN, SIZE_MAX = 1e-100, 1e100
"""The size of a number that is not 0: its square and its reciprocal are finite too."""

WHOLE_MAX = 2**53
"""Integers up to here are exact in every JSON reader. Source: RFC 8259, section 6."""


def _check_size(number: float) -> float:
    if number and not SIZE_MIN <= abs(number) <= SIZE_MAX:
        limits = {"least": f"{SIZE_MIN:g}", "most": f"{SIZE_MAX:g}"}
        raise PydanticCustomError("size", "must be 0, or from {least} to {most} in size: take another unit", limits)
    return number


Real = Annotated[float, Field(allow_inf_nan=False), AfterValidator(_check_size)]
Positive = Annotated[Real, Field(gt=0)]
NotNegative = Annotated[Real, Field(ge=0)]
Whole = Annotated[int, Field(ge=-WHOLE_MAX, le=WHOLE_MAX)]
Points = Annotated[float, Field(ge=1e-6, le=1000, allow_inf_nan=False)]
"""What a part of an exercise counts."""


def _check_order(ends: tuple[Any, Any]) -> tuple[Any, Any]:
    if ends[0] > ends[1]:
        low, high = (f"{end:g}" for end in sorted(ends))
        raise PydanticCustomError(
            "range", "runs from {high} down to {low}: write [{low}, {high}]", {"low": low, "high": high}
        )
    return ends


class Range(NamedTuple):
    """The ends of a range, from which a number is drawn. Equal ends are allowed: then nothing varies."""

    low: float
    high: float

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        """Reads a list of two numbers."""
        return _schema_of(cls, handler.generate_schema(tuple[Real, Real]))


class WholeRange(NamedTuple):
    """The first and the last whole number of a range."""

    low: int
    high: int

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        """Reads a list of two whole numbers."""
        return _schema_of(cls, handler.generate_schema(tuple[Whole, Whole]))


def _schema_of(ends: type[Range] | type[WholeRange], pair: CoreSchema) -> CoreSchema:
    def read(values: tuple[Any, Any]) -> Range | WholeRange:
        return ends(*_check_order(values))

    return core_schema.no_info_after_validator_function(read, pair)


def is_list(value: Any) -> str:
    """Returns "range" for what is written as a list, else "number"."""
    return "range" if isinstance(value, list | tuple) else "number"


Value = Annotated[Annotated[Real, Tag("number")] | Annotated[Range, Tag("range")], Discriminator(is_list)]
"""A number, or a range from which each submission's seed draws one."""

WholeValue = Annotated[Annotated[Whole, Tag("number")] | Annotated[WholeRange, Tag("range")], Discriminator(is_list)]
"""A whole number, or a range of them."""
