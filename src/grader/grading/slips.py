"""Known slips: what turns a wrong number into the right one, said in one sentence that does not give it away."""

import math
from collections.abc import Iterator
from functools import lru_cache

from grader.domain.quiz import NumericQuestion
from grader.errors import InvalidAnswer
from grader.grading.numbers import format_number
from grader.grading.quantities import Quantity
from grader.grading.units import Unit, convert, from_base_units, known_unit, look_up, symbols

FAMILIES = (
    ("nanosecond", "microsecond", "millisecond", "second", "minute", "hour"),
    ("micrometer", "millimeter", "centimeter", "meter", "kilometer"),
    ("milligram", "gram", "kilogram"),
    ("milliradian", "radian", "degree", "turn"),
    ("millinewton", "newton", "kilonewton"),
    ("millijoule", "joule", "kilojoule"),
    ("milliwatt", "watt", "kilowatt"),
    ("hertz", "kilohertz", "megahertz"),
    ("kelvin", "degree_Celsius", "degree_Fahrenheit"),
)
"""Units that are taken for one another."""

DECADES_MAX = 12
BROADEST_TOLERANCE = 0.1
"""Of |answer|: with a broader one a match would say little."""


def is_right(value: float, question: NumericQuestion) -> bool:
    """Within the tolerance, its ends included; the rounding of a conversion between units does not count."""
    if not math.isfinite(value):
        return False
    rounding = 16 * math.ulp(max(abs(value), abs(question.answer), question.tolerance))
    return abs(value - question.answer) <= question.tolerance + rounding


def find_slip(given: Quantity, question: NumericQuestion) -> str | None:
    """One sentence on what went wrong with a wrong number, or None where no known slip explains it."""
    if given.value == 0 or question.tolerance > BROADEST_TOLERANCE * abs(question.answer):
        return None
    wanted = known_unit(given.unit) if given.unit else None
    if wanted and (other := _other_unit(given, wanted, question)):
        verb = "were" if len(wanted.powers) == 1 else "was"
        meant = f"you wrote {given.typed_unit.words}" if given.typed_unit else f"{wanted.words} {verb} asked for"
        return f"Your number would be right in {other.words}, but {meant}."
    phrases = list(_single_slips(given, wanted, question)) or list(_double_slips(given.value, question))
    return f"Your number {', or '.join(phrases)}." if 0 < len(phrases) <= 2 else None


def _other_unit(given: Quantity, wanted: Unit, question: NumericQuestion) -> Unit | None:
    """The unit in which the number that was typed would have been right."""
    for unit in _neighbours(wanted):
        try:
            if is_right(convert(given.number, unit, wanted), question):
                return unit
        except InvalidAnswer:
            continue
    return None


@lru_cache(maxsize=1024)
def _neighbours(wanted: Unit) -> tuple[Unit, ...]:
    """The unit itself, and every unit that differs from it in one factor."""
    found = [wanted]
    for place, (name, power) in enumerate(wanted.powers):
        for family in FAMILIES:
            for other in family if name in family else ():
                swapped = tuple((one, power) for one in look_up(other))
                powers = (*wanted.powers[:place], *swapped, *wanted.powers[place + 1 :])
                found.append(Unit(symbols(powers), powers))
    return tuple(found)


def _single_slips(given: Quantity, wanted: Unit | None, question: NumericQuestion) -> Iterator[str]:
    value = given.value
    if is_right(-value, question):
        yield "has the wrong sign"
    if is_right(2 * value, question) or is_right(value / 2, question):
        yield "is off by a factor of two"
    if power := _power_of_ten(value, question):
        yield _power_phrase(power)
    if (wanted is None or wanted.is_angular) and (
        is_right(math.degrees(value), question) or is_right(math.radians(value), question)
    ):
        yield "mixes up degrees and radians"
    if _is_reciprocal(given, wanted, question):
        yield "is the reciprocal of what is asked"


def _double_slips(value: float, question: NumericQuestion) -> Iterator[str]:
    if is_right(-2 * value, question) or is_right(-value / 2, question):
        yield "has the wrong sign and is off by a factor of two"
    if power := _power_of_ten(-value, question):
        yield f"has the wrong sign and {_power_phrase(power)}"
    if _power_of_ten(2 * value, question) or _power_of_ten(value / 2, question):
        yield "is off by a factor of two and by a power of ten"


def _power_of_ten(value: float, question: NumericQuestion) -> int | None:
    """How many decades the number is off, either way."""
    ratio = question.answer / value if value else math.inf
    if not 0 < ratio < math.inf:
        return None
    decades = round(math.log10(ratio))
    if not 0 < abs(decades) <= DECADES_MAX or not is_right(value * 10.0**decades, question):
        return None
    return abs(decades)


def _power_phrase(power: int) -> str:
    return f"is off by a power of ten (a factor of {format_number(10.0**power)})"


def _is_reciprocal(given: Quantity, wanted: Unit | None, question: NumericQuestion) -> bool:
    """Also 200 for 5 ms: the reciprocal in base units."""
    if is_right(1 / given.value, question):
        return True
    if wanted is None or given.typed_unit is not None:
        return False
    try:
        return is_right(from_base_units(1 / given.number, wanted), question)
    except InvalidAnswer:
        return False
