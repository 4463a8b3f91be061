"""The axes on which the answers of a class lie, and where one answer lies; how stored verdicts are read for them. A
verdict is stored JSON, possibly of an older version: what cannot be read is left out."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

ROUNDING = 1e-3
"""How far a bracket may miss a limit, relative to it: evidence is rounded."""

RIGHT = "right"
"""The name of the line at 1 where each learner has a right number of their own, and answers are in its multiples."""


class Position(NamedTuple):
    """Where an answer lies: a bracket, or a number, whose ends are equal. `low` is NaN where there is no number, such
    as that of a learner who says that there is no limit, or of a run that diverged. `is_right` is the judge's outcome
    on this axis; None: whether it lies in `ClassAxis.right` tells."""

    low: float
    high: float
    is_right: bool | None = None

    @property
    def middle(self) -> float:
        """The middle of the bracket."""
        return (self.low + self.high) / 2

    @property
    def is_none(self) -> bool:
        """Whether there is no number."""
        return math.isnan(self.low)


def place_number(value: float | None, is_right: bool | None = None) -> Position:
    """Returns the position of a number; None: there is none."""
    where = math.nan if value is None else value
    return Position(where, where, is_right)


@dataclass(frozen=True)
class ClassAxis:
    """An axis of a question, in `unit`; `id` is the same in every verdict. Positions within `right` are right: an end
    is infinite where there is no limit on that side; None where it is unknown, or there is no limit at all.
    `is_limit` says that a bracket has to hold it.

    `title` says which number of several it is. `measure` is what was measured, such as `settling time`; empty where the
    number is the learner's own claim. `line` is what the line at the limit is called; empty: its number with a word
    that fits. `none` is what a position without a number is called. `is_whole`: it counts something. `marks` are values
    with names, such as that of a formula that is often taken. `note` is a sentence on what else is right."""

    id: str
    title: str
    unit: str = ""
    right: tuple[float, float] | None = None
    is_limit: bool = False
    marks: tuple[tuple[str, float], ...] = ()
    measure: str = ""
    line: str = ""
    none: str = "no limit"
    is_log: bool = False
    is_whole: bool = False
    note: str = ""

    @property
    def limit(self) -> float | None:
        """The value at which the line stands: that of the limit, the only finite end, or the middle."""
        if self.right is None:
            return None
        low, high = self.right
        if self.is_limit or not math.isfinite(high):
            return low
        return high if self.is_at_most else (low + high) / 2

    @property
    def is_at_most(self) -> bool:
        """Whether every number up to the limit is right."""
        return self.right is not None and (self.right[0] == -math.inf or (self.is_log and self.right[0] == 0))

    @property
    def is_at_least(self) -> bool:
        """Whether every number from the limit on is right."""
        return self.right is not None and self.right[1] == math.inf

    def accepts(self, position: Position) -> bool:
        """Whether a position is right on this axis."""
        if position.is_right is not None:
            return position.is_right
        if self.right is None:
            return self.is_limit and position.is_none
        low, high = self.right
        if self.is_limit:
            return position.low <= high * (1 + ROUNDING) and position.high >= low * (1 - ROUNDING)
        return low <= position.low <= position.high <= high


Placed = tuple[ClassAxis, Position | None]
"""An axis of a verdict, and where its answer lies there; None where it gave nothing that could be placed."""


def list_parts(verdict: Mapping[str, Any], name: str) -> list[dict[str, Any]]:
    """Returns the objects with a `case` in a list of the evidence."""
    value = (verdict.get("evidence") or {}).get(name)
    parts = value if isinstance(value, list) else []
    return [part for part in parts if isinstance(part, dict) and isinstance(part.get("case"), str)]


def list_findings(verdict: Mapping[str, Any]) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Yields each finding after its id."""
    for finding in verdict.get("findings") or ():
        if isinstance(finding, dict) and isinstance(finding.get("id"), str):
            yield finding["id"], finding


def read_title(finding: Mapping[str, Any], otherwise: str) -> str:
    """Returns the title of a finding."""
    return str(finding.get("title") or otherwise)


def read_passed(finding: Mapping[str, Any]) -> bool | None:
    """Returns whether a finding passed; None where that is undecided."""
    passed = finding.get("passed")
    return passed if isinstance(passed, bool) else None


def read_number(value: Any) -> float | None:
    """Returns a finite number; None for any other value."""
    is_number = isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
    return float(value) if is_number else None


def read_numbers(value: Any) -> list[float] | None:
    """Returns a finite number, or a list of them, as a list; None for any other value."""
    numbers = [
        read_number(item) for item in (value if isinstance(value, Sequence) and not isinstance(value, str) else [value])
    ]
    known = [number for number in numbers if number is not None]
    return known if known and len(known) == len(numbers) else None
