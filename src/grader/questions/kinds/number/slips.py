"""Compare a number with its key, and find known slips: changes that turn a wrong number into the right one. Sentences
do not reveal it."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from functools import lru_cache

from grader.domain.verdict import Finding
from grader.errors import InvalidAnswer
from grader.questions.answer_keys import NumberKey
from grader.questions.kinds.number.quantities import Quantity, format_number
from grader.questions.kinds.number.units import (
    FAMILIES,
    Rotation,
    Unit,
    convert,
    from_base_units,
    known_unit,
    write_symbols,
)

DECADES_MAX = 12
GRAVITIES = (9.81, math.pi**2)
"""Factors near 10 that are named in its place where the number is off by nearly them: 2 for a weight of 19.62 N."""
FACTOR_OFF_MAX = 0.006
"""Largest relative difference from such a factor: not quite half the way from pi² to 10."""
NEAR_MAX = 0.02
"""Largest relative difference from a factor such as 50 that is named."""
APART_MIN = 6.0
"""How many tolerances a number is from the answer at least, to be called its reciprocal, square or root: near 1 any of
the three is within the tolerance."""
BROADEST_TOLERANCE = 0.1
"""Largest tolerance relative to |answer| at which slips are sought; within a wider one many slips match by chance."""

SLIPS_MAX = 2
"""The largest number of matching slips; with more of them none is named, as it would be a guess."""


PERIODS = frozenset(((name, 1),) for name in FAMILIES[0])
RADIANS_PER_SECOND, TURNS_PER_MINUTE = (("radian", 1), ("second", -1)), (("revolutions_per_minute", 1),)
"""Units of a period, an angular frequency and a speed of rotation."""


@dataclass(frozen=True)
class Slip:
    """A known mistake: what is seen of the number (`Your number ...`), and the cure."""

    seen: str
    cure: str


def is_right(value: float, key: NumberKey) -> bool:
    """Whether a value lies within the tolerance, ends included; the rounding of a unit conversion does not count."""
    if not math.isfinite(value):
        return False
    rounding = 16 * math.ulp(max(abs(value), abs(key.answer), key.tolerance))
    return abs(value - key.answer) <= key.tolerance + rounding


SIZES = (
    (1.1, "by less than 10 %"),
    (2.0, "by less than a factor of two"),
    (10.0, "by a factor of two to ten"),
    (math.inf, "by more than a factor of ten"),
)
"""In words so coarse that they do not give the answer: the largest ratio of the two numbers, and what is said."""


def size_of(given: Quantity, key: NumberKey) -> str:
    """Return how far off a wrong number is; empty where its ratio to the answer says nothing."""
    if given.value * key.answer <= 0 or key.tolerance > BROADEST_TOLERANCE * abs(key.answer):
        return ""
    with_answer = sorted((abs(given.value), abs(key.answer)))
    ratio = with_answer[1] / with_answer[0]
    return next((words for most, words in SIZES if ratio < most), SIZES[-1][1])


def grade_number(
    key: NumberKey, given: Quantity, points: float, name: str = "number", title: str = "Your number"
) -> tuple[Finding, str | None]:
    """Compares a number with its key, and returns the known slip behind a wrong one, if any. `direction` of the finding
    says whether it is too high, the message also about how far."""
    passed = is_right(given.value, key)
    message = direction = f"{given.text} is right."
    if not passed:
        side, size = f"{given.text} is too {'high' if given.value > key.answer else 'low'}", size_of(given, key)
        message, direction = f"{side}{', ' if size else ''}{size}.", f"{side}."
    finding = Finding(
        id=name, title=title, passed=passed, points=points if passed else 0.0, max_points=points, message=message,
        direction=direction, measured=given.value, expected=key.answer
    )  # fmt: skip
    return finding, None if passed else find_slip(given, key)


SIGN = Slip("has the wrong sign", "check whether it can be negative at all, and which direction counts as positive")
TWO = Slip("is off by a factor of two", "look for a factor that is missing or counted twice")
ANGLE = Slip("mixes up degrees and radians", "convert the angle")
RECIPROCAL = Slip("is the reciprocal of what is asked", "swap numerator and denominator")
SQUARE = Slip("is the square of what is asked", "look for a square root that is missing")
ROOT = Slip("is the square root of what is asked", "look for a square root that is one too many")
GRAVITY = Slip(
    "is off by a factor of about 9.8", "look for gravity, 9.81 m/s², or pi² that is missing or counted twice"
)
GRAVITY_AND_TWO = Slip(
    "is off by a factor of about 4.9 or 19.6",
    "look for gravity, 9.81 m/s², or pi² that is missing or counted twice, and for a factor of two",
)
TURNS = Slip("is off by a factor of 2 pi", "frequency in Hz and angular frequency in rad/s differ by it")
PERIOD = Slip("is off by a factor of 2 pi", "a period is 2 pi over the angular frequency")
ANGULAR = Slip("is 2 pi over what is asked", "period and angular frequency are 2 pi over each other")
PER_MINUTE = Slip("would be right in revolutions per minute", "1 rpm is 2 pi/60 rad/s")
PER_SECOND = Slip("would be right in radians per second", "1 rad/s is 60/(2 pi) rpm")
SIGN_AND_TWO = Slip("has the wrong sign and is off by a factor of two", "check the signs first, then the factors")


def _ten(power: int, seen: str = "") -> Slip:
    factor = format_number(10.0**power)
    return Slip(f"{seen}is off by a power of ten (a factor of {factor})", "check the exponents and the unit prefixes")


def _two_and_ten(ratio: float) -> Iterator[Slip]:
    """Yields the slip of a factor such as 5, 20 or 50: it may be one of 5, or one of 2 and one of 10."""
    factor = max(ratio, 1 / ratio)
    decade = 10.0 ** math.floor(math.log10(factor) + 0.15)
    nearest = min((2 * decade, 5 * decade, decade / 2), key=lambda each: abs(math.log(each / factor)))
    if abs(math.log(nearest / factor)) < NEAR_MAX:
        seen = f"is off by a factor of {format_number(nearest)}"
        yield Slip(seen, "look for a factor that is missing or counted twice, and check the unit prefixes")


def find_slip(given: Quantity, key: NumberKey) -> str | None:
    """Return one sentence with the slip and its cure; None where no known slip explains the number."""
    if given.value == 0 or key.tolerance >= abs(key.answer):
        return None
    if key.tolerance > BROADEST_TOLERANCE * abs(key.answer):
        return write_sentence([SIGN] if is_right(-given.value, key) else [])
    key = narrow_key(key, given)
    wanted = known_unit(given.unit) if given.unit else None
    if wanted and (other := _other_unit(given, wanted, key)):
        return _unit_slip(given, wanted, other)
    return write_sentence(list(_single_slips(given, wanted, key)) or list(_double_slips(given.value, key)))


def narrow_key(key: NumberKey, given: Quantity) -> NumberKey:
    """Returns the key with the tolerance for slips: no wider than half a unit of the last digit of the number or of the
    answer, whichever has fewer, or `FACTOR_OFF_MAX`. Within 2 % of the answer many slips match a number by chance."""
    digits = min(given.digits, count_significant(given.number), count_significant(key.answer))
    nearest = max(0.5 * 10.0 ** (1 - digits), FACTOR_OFF_MAX) * abs(key.answer)
    return replace(key, tolerance=min(key.tolerance, nearest))


def count_significant(value: float) -> int:
    """Returns how many digits write a number, without zeros at its ends."""
    return len(Decimal(repr(value)).normalize().as_tuple().digits)


def write_sentence(slips: Sequence[Slip]) -> str | None:
    """Return the sentence of one slip, or of two that are possible; None for more, which would be a guess."""
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


def _other_unit(given: Quantity, wanted: Unit, key: NumberKey) -> Unit | None:
    """Find the unit in which the typed number would have been right."""
    for unit, scale, offset in _neighbours(wanted):
        if is_right(scale * given.number + offset, key):
            return unit
    return None


@lru_cache(maxsize=1024)
def _neighbours(wanted: Unit) -> tuple[tuple[Unit, float, float], ...]:
    """List the unit itself and every unit that differs from it in one factor, each with how its numbers are converted.
    The scale and the offset are kept, since to convert one number takes as long as all else in grading it."""
    units = [wanted]
    for place, (name, power) in enumerate(wanted.powers):
        for family in FAMILIES:
            for other in family if name in family else ():
                powers = (*wanted.powers[:place], (other, power), *wanted.powers[place + 1 :])
                units.append(Unit(write_symbols(powers), powers))
    return tuple((unit, *scale) for unit in units if (scale := _scale(unit, wanted)) is not None)


def _scale(unit: Unit, wanted: Unit) -> tuple[float, float] | None:
    """Return the factor and then the summand that convert a number; None where the units measure different things."""
    try:
        offset = convert(0.0, unit, wanted)
        return convert(1.0, unit, wanted) - offset, offset
    except InvalidAnswer:
        return None


def _single_slips(given: Quantity, wanted: Unit | None, key: NumberKey) -> Iterator[Slip]:
    value = given.value
    if is_right(-value, key):
        yield SIGN
    yield from _factor_slips(value, key)
    if wanted:
        yield from _turn_slips(given, wanted, key)
    if (wanted is None or wanted.radians) and (
        is_right(math.degrees(value), key) or is_right(math.radians(value), key)
    ):
        yield ANGLE
    if _is_reciprocal(given, wanted, key):
        yield RECIPROCAL
    if value > 0 and is_apart(value, key):
        if is_right(math.sqrt(value), key):
            yield SQUARE
        if is_right(value * value, key):
            yield ROOT


def _factor_slips(value: float, key: NumberKey) -> Iterator[Slip]:
    if is_right(2 * value, key) or is_right(value / 2, key):
        yield TWO
    if is_off_by(GRAVITIES, value, key):
        yield GRAVITY
    elif power := _power_of_ten(value, key):
        yield _ten(power)


def _turn_slips(given: Quantity, wanted: Unit, key: NumberKey) -> Iterator[Slip]:
    """Yields what is confused of a period, a frequency, an angular frequency and turns per minute."""
    value, is_period = given.value, wanted.powers in PERIODS
    if is_off_by((math.tau,), value, key):
        if is_period:
            yield PERIOD
        elif wanted.powers == RADIANS_PER_SECOND or wanted.rotation in (Rotation.CYCLES, Rotation.TURNS):
            yield TURNS
    if wanted.powers == RADIANS_PER_SECOND and is_right(value * math.tau / 60, key):
        yield PER_MINUTE
    if wanted.powers == TURNS_PER_MINUTE and is_right(value * 60 / math.tau, key):
        yield PER_SECOND
    scale = _base_scale(wanted) if is_period or wanted.powers == RADIANS_PER_SECOND else None
    if scale and is_apart(value, key) and is_right(math.tau * scale / given.number, key):
        yield ANGULAR


def _double_slips(value: float, key: NumberKey) -> Iterator[Slip]:
    if is_right(-2 * value, key) or is_right(-value / 2, key):
        yield SIGN_AND_TWO
    if power := _power_of_ten(-value, key):
        yield _ten(power, seen="has the wrong sign and ")
    if is_off_by(GRAVITIES, 2 * value, key) or is_off_by(GRAVITIES, value / 2, key):
        yield GRAVITY_AND_TWO
    elif _power_of_ten(2 * value, key) or _power_of_ten(value / 2, key):
        yield from _two_and_ten(key.answer / value)


def compare_logarithms(value: float, key: NumberKey) -> float:
    """Returns the logarithm of the factor between a number and the answer; 0 for another sign, or none."""
    if value == 0 or (value > 0) is not (key.answer > 0):
        return 0.0
    return abs(math.log(abs(value)) - math.log(abs(key.answer)))


def is_apart(value: float, key: NumberKey) -> bool:
    """Whether a number of the answer's sign is far enough from it to be told from its powers."""
    return compare_logarithms(value, key) > APART_MIN * key.tolerance / abs(key.answer)


def is_off_by(factors: Sequence[float], value: float, key: NumberKey) -> bool:
    """Whether the number times or through one of these factors is the answer: within its tolerance, and nearly."""
    ratio = compare_logarithms(value, key)
    near = any(abs(ratio - math.log(factor)) < FACTOR_OFF_MAX for factor in factors)
    return near and any(is_right(value * factor, key) or is_right(value / factor, key) for factor in factors)


def _power_of_ten(value: float, key: NumberKey) -> int | None:
    """Return the power of ten by which the number is off; None where it is off by anything else."""
    ratio = key.answer / value if value else math.inf
    if not 0 < ratio < math.inf:
        return None
    decades = round(math.log10(ratio))
    if not 0 < abs(decades) <= DECADES_MAX or not is_right(value * 10.0**decades, key):
        return None
    return abs(decades)


def _is_reciprocal(given: Quantity, wanted: Unit | None, key: NumberKey) -> bool:
    """Whether the number is the reciprocal of the answer, also in base units: 200 for 5 ms."""
    if is_apart(given.value, key) and is_right(1 / given.value, key):
        return True
    if wanted is None or (given.typed_unit is not None and given.typed_unit.powers != wanted.powers):
        return False
    scale = _base_scale(wanted)
    return scale is not None and is_right(scale / given.number, key)


@lru_cache(maxsize=1024)
def _base_scale(wanted: Unit) -> float | None:
    """Return what 1 in base units is in a unit; None where it is no multiple, or not known."""
    try:
        return None if from_base_units(0.0, wanted) else from_base_units(1.0, wanted)
    except InvalidAnswer:
        return None
