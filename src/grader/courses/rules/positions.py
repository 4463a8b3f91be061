"""Where the answers to a question lie on its axes: numbers and brackets that learners claim, and what was measured of
their scripts. Evidence is stored JSON, possibly of an older version, so what cannot be read is left out. Pure."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any

from grader.domain.axes import RIGHT, ClassAxis, Placed, Position, list_findings, place_number, read_number, read_passed
from grader.exercises import find_placing
from grader.questions import NumberKey, Question, kind_of
from grader.questions.drawing import is_drawn

ONE = "The answer"
TIMES = "times the right number"

Place = Callable[[Mapping[str, Any]], Iterable[Placed]]


def choose_placing(question: Question) -> Place:
    """Returns what places a stored verdict on the question's axes; it places none where the question has no number."""
    kind = kind_of(question)
    if kind.is_script:
        return find_placing(question)
    keys = [key for key in kind.answer_keys(question) if isinstance(key, NumberKey)]
    names = [number.text for number in kind.numbers(question)] or [""] * len(keys)
    if len(names) != len(keys):
        return lambda verdict: ()
    if is_drawn(question):
        return partial(place_ratios, list(zip(keys, names, strict=True)))
    return partial(place_numbers, list_number_axes(keys, names))


def list_number_axes(keys: Sequence[NumberKey], names: Sequence[str]) -> list[ClassAxis]:
    """Returns the axis of each number, with what is accepted."""
    return [
        ClassAxis(f"n{place}", name or ONE, key.unit or "", (key.answer - key.tolerance, key.answer + key.tolerance))
        for place, (key, name) in enumerate(zip(keys, names, strict=True))
    ]


def place_numbers(axes: Sequence[ClassAxis], verdict: Mapping[str, Any]) -> Iterator[Placed]:
    """Yields each axis, with the number in the evidence. A right one of several is not kept: it stands on its line."""
    value = (verdict.get("evidence") or {}).get("value")
    given = value if isinstance(value, list) else [value]
    for place, axis in enumerate(axes):
        number = read_number(given[place]) if place < len(given) else None
        if number is None and isinstance(value, list) and place < len(given):
            number = axis.limit
        yield axis, None if number is None else place_number(number)


def place_ratios(keys: Sequence[tuple[NumberKey, str]], verdict: Mapping[str, Any]) -> Iterator[Placed]:
    """Yields an axis for each number that is drawn: there every learner has a right number of their own, and stands
    where theirs is in its multiples."""
    measured = [(finding, read_number(finding.get("measured"))) for _, finding in list_findings(verdict)]
    given = [(finding, number) for finding, number in measured if number is not None]
    if len(given) != len(keys):
        return
    for place, ((key, name), (finding, number)) in enumerate(zip(keys, given, strict=True)):
        right = read_number(finding.get("expected"))
        around = key.tolerance / abs(key.answer) if key.answer else 0.0
        axis = ClassAxis(f"n{place}", name or ONE, TIMES, (1 - around, 1 + around), line=RIGHT)
        yield axis, place_number(number / right, read_passed(finding)) if right else None


def merge_axes(several: Iterable[Iterable[ClassAxis]]) -> list[ClassAxis]:
    """Returns the axes of many verdicts, each once; where one verdict knows the limit, it is known."""
    merged: dict[str, ClassAxis] = {}
    for axes in several:
        for axis in axes:
            before = merged.get(axis.id)
            if before is None or (before.right is None and axis.right is not None):
                merged[axis.id] = axis
    return list(merged.values())


def read_positions(placed: Iterable[Placed]) -> dict[str, Position]:
    """Returns where an answer lies, by axis."""
    return {axis.id: position for axis, position in placed if position is not None}
