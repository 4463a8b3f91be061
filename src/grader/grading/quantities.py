"""A typed answer to a numeric question: a number, with or without a unit, in the unit of the question."""

from dataclasses import dataclass
from typing import Any

from grader.errors import InvalidAnswer
from grader.grading.numbers import TypedNumber, finite, format_number, quoted, read_number
from grader.grading.units import Unit, convert, known_unit, plain_unit, read_unit

PROPORTIONS = {"percent", "permille", "ppm"}
"""Units that a question without a unit accepts."""

NO_UNIT = Unit("", ())


@dataclass(frozen=True)
class Quantity:
    """What was understood: `value` in the question's unit, and what was typed to say so."""

    value: float
    number: float
    typed_unit: Unit | None
    unit: str

    def __str__(self) -> str:
        """The answer in the question's unit, `5 ms`."""
        return f"{format_number(self.value)} {self.unit}".strip()


def read_quantity(answer: Any, unit: str | None) -> Quantity:
    """A JSON number or a text, converted to the question's unit, which is assumed where none is typed.

    Raises InvalidAnswer with one sentence that says why, and what would be readable.
    """
    shown = plain_unit(unit or "")
    if isinstance(answer, bool) or not isinstance(answer, int | float | str):
        raise InvalidAnswer(f"The answer must be a number{f' in {shown}' if shown else ''}, or text with a number.")
    if not isinstance(answer, str):
        value = _as_float(answer)
        return Quantity(value, value, None, shown)
    number = read_number(answer)
    if not number.rest or _same_label(number.rest, shown):
        return Quantity(number.value, number.value, None, shown)
    return _with_unit(number, shown, answer)


def _as_float(answer: float) -> float:
    try:
        return finite(float(answer), str(answer)[:50])
    except (OverflowError, ValueError) as error:
        raise InvalidAnswer("The number is too large.") from error


def _same_label(typed: str, shown: str) -> bool:
    """`5 Steps` where the question counts `steps`: no unit that could be converted, but the very word."""
    return known_unit(shown) is None and typed.casefold().rstrip(".s") == shown.casefold().rstrip(".s")


def _with_unit(number: TypedNumber, shown: str, answer: str) -> Quantity:
    wanted = known_unit(shown) if shown else NO_UNIT
    advice = f"give the answer in {shown}" if shown else "give a number without a unit"
    if wanted is None:
        raise InvalidAnswer(f"{quoted(number.rest)} is not what is counted: {advice}.")
    try:
        typed = read_unit(number.rest.removesuffix("."))
    except InvalidAnswer as error:
        raise InvalidAnswer(f"{str(error).removesuffix('.')}: {advice}.") from error
    if not shown and not {name for name, _ in typed.powers} <= PROPORTIONS:
        raise InvalidAnswer(f"{quoted(number.rest)} is a unit, but a plain number is asked: {advice}.")
    value = finite(convert(number.value, typed, wanted), answer)
    return Quantity(value, number.value, typed, shown)
