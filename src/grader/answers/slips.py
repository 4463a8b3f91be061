"""Find known slips: changes that turn a wrong number into the right one. Sentences do not reveal it."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

from grader.answers.numbers import format_number
from grader.answers.quantities import Quantity
from grader.answers.units import FAMILIES, Unit, convert, from_base_units, known_unit, symbols
from grader.domain.quiz import NumericQuestion
from grader.errors import InvalidAnswer

DECADES_MAX = 12
BROADEST_TOLERANCE = 0.1
"""Largest tolerance relative to |answer| at which slips are sought; within a wider one many slips match by chance."""

SLIPS_MAX = 2
"""The largest number of matching slips; with more of them none is named, as it would be a guess."""


@dataclass(frozen=True)
class Slip:
    """A known mistake: what is seen of the number (`Your number ...`), and the cure."""

    seen: str
    cure: str


def is_right(value: float, question: NumericQuestion) -> bool:
    """Whether a value lies within the tolerance, ends included; the rounding of a unit conversion does not count."""
    if not math.isfinite(value):
        return False
    rounding = 16 * math.ulp(max(abs(value), abs(question.answer), question.tolerance))
    return abs(value - question.answer) <= question.tolerance + rounding


SIZES = (
    (1.1, "by less than 10 %"),
    (2.0, "by less than a factor of two"),
    (10.0, "by a factor of two to ten"),
    (math.inf, "by more than a factor of ten"),
)
"""In words so coarse that they do not give the answer: the largest ratio of the two numbers, and what is said."""


def size_of(given: Quantity, question: NumericQuestion) -> str:
    """Return how far off a wrong number is; empty where its ratio to the answer says nothing."""
    if given.value * question.answer <= 0 or question.tolerance > BROADEST_TOLERANCE * abs(question.answer):
        return ""
    with_answer = sorted((abs(given.value), abs(question.answer)))
    ratio = with_answer[1] / with_answer[0]
    return next((words for most, words in SIZES if ratio < most), SIZES[-1][1])


SIGN = Slip("has the wrong sign", "check which direction counts as positive")
TWO = Slip("is off by a factor of two", "look for a factor that is missing or counted twice")
ANGLE = Slip("mixes up degrees and radians", "convert the angle")
RECIPROCAL = Slip("is the reciprocal of what is asked", "swap numerator and denominator")
SIGN_AND_TWO = Slip("has the wrong sign and is off by a factor of two", "check the signs first, then the factors")
TWO_AND_TEN = Slip("is off by a factor of two and by a power of ten", "check the unit prefixes first, then the factors")


def _ten(power: int, seen: str = "") -> Slip:
    factor = format_number(10.0**power)
    return Slip(f"{seen}is off by a power of ten (a factor of {factor})", "check the exponents and the unit prefixes")


def find_slip(given: Quantity, question: NumericQuestion) -> str | None:
    """Return one sentence with the slip and its cure; None where no known slip explains the number."""
    if given.value == 0 or question.tolerance > BROADEST_TOLERANCE * abs(question.answer):
        return None
    wanted = known_unit(given.unit) if given.unit else None
    if wanted and (other := _other_unit(given, wanted, question)):
        return _unit_slip(given, wanted, other)
    slips = list(_single_slips(given, wanted, question)) or list(_double_slips(given.value, question))
    if not 0 < len(slips) <= SLIPS_MAX:
        return None
    seen, cure = (", or ".join(parts) for parts in ([slip.seen for slip in slips], [slip.cure for slip in slips]))
    return f"Your number {seen}: {cure}."


def _unit_slip(given: Quantity, wanted: Unit, other: Unit) -> str:
    if given.typed_unit:
        seen, cure = f"you wrote {given.typed_unit.words}", "correct the unit or the number"
    else:
        verb = "were" if len(wanted.powers) == 1 else "was"
        seen, cure = f"{wanted.words} {verb} asked for", "convert it, or type its unit as well"
    return f"Your number would be right in {other.words}, but {seen}: {cure}."


def _other_unit(given: Quantity, wanted: Unit, question: NumericQuestion) -> Unit | None:
    """Find the unit in which the typed number would have been right."""
    for unit in _neighbours(wanted):
        try:
            if is_right(convert(given.number, unit, wanted), question):
                return unit
        except InvalidAnswer:
            continue
    return None


@lru_cache(maxsize=1024)
def _neighbours(wanted: Unit) -> tuple[Unit, ...]:
    """List the unit itself and every unit that differs from it in one factor."""
    found = [wanted]
    for place, (name, power) in enumerate(wanted.powers):
        for family in FAMILIES:
            for other in family if name in family else ():
                powers = (*wanted.powers[:place], (other, power), *wanted.powers[place + 1 :])
                found.append(Unit(symbols(powers), powers))
    return tuple(found)


def _single_slips(given: Quantity, wanted: Unit | None, question: NumericQuestion) -> Iterator[Slip]:
    value = given.value
    if is_right(-value, question):
        yield SIGN
    if is_right(2 * value, question) or is_right(value / 2, question):
        yield TWO
    if power := _power_of_ten(value, question):
        yield _ten(power)
    if (wanted is None or wanted.is_angular) and (
        is_right(math.degrees(value), question) or is_right(math.radians(value), question)
    ):
        yield ANGLE
    if _is_reciprocal(given, wanted, question):
        yield RECIPROCAL


def _double_slips(value: float, question: NumericQuestion) -> Iterator[Slip]:
    if is_right(-2 * value, question) or is_right(-value / 2, question):
        yield SIGN_AND_TWO
    if power := _power_of_ten(-value, question):
        yield _ten(power, seen="has the wrong sign and ")
    if _power_of_ten(2 * value, question) or _power_of_ten(value / 2, question):
        yield TWO_AND_TEN


def _power_of_ten(value: float, question: NumericQuestion) -> int | None:
    """Return the power of ten by which the number is off; None where it is off by anything else."""
    ratio = question.answer / value if value else math.inf
    if not 0 < ratio < math.inf:
        return None
    decades = round(math.log10(ratio))
    if not 0 < abs(decades) <= DECADES_MAX or not is_right(value * 10.0**decades, question):
        return None
    return abs(decades)


def _is_reciprocal(given: Quantity, wanted: Unit | None, question: NumericQuestion) -> bool:
    """Whether the number is the reciprocal of the answer, also in base units: 200 for 5 ms."""
    if is_right(1 / given.value, question):
        return True
    if wanted is None or given.typed_unit is not None:
        return False
    try:
        return is_right(from_base_units(1 / given.number, wanted), question)
    except InvalidAnswer:
        return False
