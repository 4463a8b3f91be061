"""Rubric: the items that a reviewer ticks, and their points; and the rule for marking answers a second time."""

import math
from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationInfo
from pydantic_core import PydanticCustomError

ROUNDING = 1e-9
"""Tolerance of a sum of points: decimals that add up may not do so in binary."""


class RubricItem(BaseModel):
    """One item to tick. Its points are added; negative points are deducted. Items with the same `group` appear together
    under that heading."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    id: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$")
    title: str = Field(min_length=1)
    points: float = Field(ge=-1000, le=1000, strict=True, allow_inf_nan=False)
    group: str | None = Field(default=None, min_length=1)


def _usable(items: tuple[RubricItem, ...], info: ValidationInfo) -> tuple[RubricItem, ...]:
    """Item ids are unique, and full marks can be reached."""
    ids = [item.id for item in items]
    if repeated := sorted({id_ for id_ in ids if ids.count(id_) > 1}):
        raise PydanticCustomError("rubric", "two items have the id {id}: give each its own", {"id": repeated[0]})
    most, points = math.fsum(item.points for item in items if item.points > 0), info.data.get("points")
    if items and points is not None and most < points - ROUNDING:
        numbers = {"most": f"{most:g}", "points": f"{points:g}"}
        raise PydanticCustomError(
            "rubric", "the items add up to {most} of {points} points: add items or points", numbers
        )
    return items


ITEMS_MAX = 100

Rubric = Annotated[tuple[RubricItem, ...], Field(max_length=ITEMS_MAX), AfterValidator(_usable)]
"""The items of one question; `points` of the question must come before it in the class."""


class SecondMarking(BaseModel):
    """A second reviewer marks a random `share` of the reviewed answers, without seeing the first one's mark. Two marks
    that differ by more than `tolerance` points are a disagreement."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    share: float = Field(ge=0, le=1, strict=True, allow_inf_nan=False)
    tolerance: float = Field(default=0.0, ge=0, le=1000, strict=True, allow_inf_nan=False)

    def agree(self, one: float, other: float) -> bool:
        """Whether two marks differ by no more than the tolerance."""
        return abs(one - other) <= self.tolerance + ROUNDING
