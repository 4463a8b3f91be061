"""Known slips: what turns a wrong number into the right one, said in one sentence that does not give it away."""

import math
from collections.abc import Callable, Iterator

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

POWERS_OF_TEN = [k for k in range(-12, 13) if k]
BROADEST_TOLERANCE = 0.1
"""Of |answer|: with a broader one a match would say little."""

Right = Callable[[float], bool]


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

    def right(value: float) -> bool:
        return is_right(value, question)

    wanted = known_unit(given.unit) if given.unit else None
    if wanted and (other := _other_unit(given, wanted, right)):
        verb = "were" if len(wanted.powers) == 1 else "was"
        meant = f"you wrote {given.typed_unit.words}" if given.typed_unit else f"{wanted.words} {verb} asked for"
        return f"Your number would be right in {other.words}, but {meant}."
    phrases = list(_single_slips(given, wanted, right)) or list(_double_slips(given.value, right))
    return f"Your number {', or '.join(phrases)}." if 0 < len(phrases) <= 2 else None


def _other_unit(given: Quantity, wanted: Unit, right: Right) -> Unit | None:
    """The unit in which the number that was typed would have been right."""
    for unit in _neighbours(wanted):
        try:
            if right(convert(given.number, unit, wanted)):
                return unit
        except InvalidAnswer:
            continue
    return None


def _neighbours(wanted: Unit) -> Iterator[Unit]:
    """The unit itself, and every unit that differs from it in one factor."""
    yield wanted
    for place, (name, power) in enumerate(wanted.powers):
        for family in FAMILIES:
            for other in family if name in family else ():
                powers = (
                    *wanted.powers[:place],
                    *((one, power) for one in look_up(other)),
                    *wanted.powers[place + 1 :],
                )
                yield Unit(symbols(powers), powers)


def _single_slips(given: Quantity, wanted: Unit | None, right: Right) -> Iterator[str]:
    value = given.value
    if right(-value):
        yield "has the wrong sign"
    if right(2 * value) or right(value / 2):
        yield "is off by a factor of two"
    if power := _power_of_ten(value, right):
        yield _power_phrase(power)
    if (wanted is None or wanted.is_angular) and (right(math.degrees(value)) or right(math.radians(value))):
        yield "mixes up degrees and radians"
    if _is_reciprocal(given, wanted, right):
        yield "is the reciprocal of what is asked"


def _double_slips(value: float, right: Right) -> Iterator[str]:
    if right(-2 * value) or right(-value / 2):
        yield "has the wrong sign and is off by a factor of two"
    if power := _power_of_ten(-value, right):
        yield f"has the wrong sign and {_power_phrase(power)}"
    if _power_of_ten(2 * value, right) or _power_of_ten(value / 2, right):
        yield "is off by a factor of two and by a power of ten"


def _power_of_ten(value: float, right: Right) -> int | None:
    """How many decades the number is off, either way."""
    return next((abs(k) for k in POWERS_OF_TEN if right(value * 10.0**k)), None)


def _power_phrase(power: int) -> str:
    return f"is off by a power of ten (a factor of {format_number(10.0**power)})"


def _is_reciprocal(given: Quantity, wanted: Unit | None, right: Right) -> bool:
    """Also 200 for 5 ms: the reciprocal in base units."""
    if right(1 / given.value):
        return True
    if wanted is None or given.typed_unit is not None:
        return False
    try:
        return right(from_base_units(1 / given.number, wanted))
    except InvalidAnswer:
        return False
