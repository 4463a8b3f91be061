"""Read units as people type them, name by name. No text is ever evaluated.

pint takes long to import and to define its units, so both wait for a unit that COMMON does not name, or a conversion
that is not in COMMON_FACTORS.
"""

import math
import re
import threading
from dataclasses import dataclass
from difflib import get_close_matches
from enum import Enum, auto
from functools import cache, cached_property, lru_cache
from typing import TYPE_CHECKING, Any

from grader.domain.pages.markup import quoted
from grader.errors import InvalidAnswer
from grader.questions.kinds.number.spelling import fold, without_markup
from grader.questions.kinds.number.unit_names import COMMON, COUNTED, IN_ANY_CASE, JOINED, SPELLINGS, TWO_MEANINGS

if TYPE_CHECKING:
    import pint

CHARACTERS_MAX = 60
"""The longest text that is read as a unit."""

FACTOR = re.compile(
    r"""
    (?P<times>\ ?[*.-]\ ?|\ ?(?P<over>/|per\ )\ ?|\ )?
    (?P<open>\(\ ?)?
    (?P<name>(?:[^\W\dπ]|[°%‰])+)
    (?:(?:\ ?(?:\^|\*\*)\ ?(?P<bracket>\()?)?(?P<power>[+-]?[1-9])(?![0-9]|\.[0-9])(?(bracket)\)))?
    (?P<close>\ ?\)(?:\ ?(?:\^|\*\*)?\ ?(?P<group_power>[+-]?[1-9])(?![0-9]|\.[0-9]))?)?
    """,
    re.VERBOSE,
)
"""One factor of a product of units and the sign before it; every part after the name is optional."""

POWERS = {"square": 2, "sq": 2, "cubic": 3}
POWER_BEFORE = re.compile(r"\b(square|sq|cubic) ([A-Za-z]+)")
PERCENT_APART = re.compile(r"\b(?:per|pour|por) (?:cento?|ciento)\b", re.I)
PREFIX_APART = re.compile(r"\b(micro|milli|centi|kilo|mega)[ -](?=[A-Za-z])")
"""`square meters` and `milli seconds`."""

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
"""Units that students confuse with one another."""

SUGGESTED = [spelled for family in FAMILIES for name in family for spelled in (f"{name}s", name)]
SIMILARITY_MIN = 0.8
"""difflib's similarity, 0 to 1, at which a unit is suggested: `miliseconds` is 0.96 from `milliseconds`."""

SCALES_WITH_OFFSET = ("degree_Celsius", "degree_Fahrenheit", "degree_Reaumur")
"""Temperature scales. In a product they mean differences: a degree Celsius per metre is a kelvin per metre."""

LOGARITHMIC = ("bel", "neper", "decade", "octave", "decibelwatt", "decibelmilliwatt", "decibelmicrowatt")
"""Units of levels, which are not converted: a negative ratio has no level."""

SAME_IN_PLURAL = ("hertz", "siemens", "Celsius", "Fahrenheit", "percent", "lux", " per minute", " per second")

TURNS = ("turn", "revolutions_per_minute", "revolutions_per_second")

Powers = tuple[tuple[str, int], ...]
"""The power of every named unit in a product."""

_lock = threading.Lock()


class Rotation(Enum):
    """How a unit counts rotation."""

    CYCLES = auto()
    TURNS = auto()
    ANGLE = auto()
    NONE = auto()


SECONDS, MILLISECONDS = (("second", 1),), (("millisecond", 1),)
PER_MINUTE: Powers = (("minute", -1),)
"""`1/min`, in which Europe writes revolutions per minute."""

COMMON_FACTORS: dict[tuple[Powers, Powers], float] = {
    (SECONDS, MILLISECONDS): 1000.0,
    (MILLISECONDS, SECONDS): 0.001,
    (PER_MINUTE, (("revolutions_per_minute", 1),)): 1.0,
}
"""Factors that most content of this course needs, with the bits of pint, which they spare a start; and one that pint
does not know."""

UNCLEAR = frozenset(frozenset(pair) for pair in ((Rotation.CYCLES, Rotation.ANGLE), (Rotation.TURNS, Rotation.NONE)))
"""Conversions with two readings: `1 Hz` can mean 1 or 2 pi rad/s, and `1 rpm` 1 or 2 pi per minute."""


@dataclass(frozen=True)
class Unit:
    """A unit known to pint: how it was written, and the power of every named unit in it."""

    text: str
    powers: Powers

    @cached_property
    def quantity(self) -> "pint.Unit":
        """The same unit for pint's conversions."""
        from pint.util import UnitsContainer

        return get_registry().Unit(UnitsContainer(dict(self.powers)))

    @property
    def words(self) -> str:
        """`milliseconds (ms)` for a single unit; what was written for a product of units."""
        if len(self.powers) != 1 or self.powers[0][1] != 1:
            return self.text
        name = self.powers[0][0].replace("_", " ")
        plural = name if name.endswith(SAME_IN_PLURAL) else f"{name}s"
        plural = plural.replace("degree ", "degrees ")
        return plural if self.text in (name, plural) else f"{plural} ({self.text})"

    @cached_property
    def radians(self) -> float:
        """The power of an angle in the unit: 1 for radians, degrees and turns, and for rpm, which contains a turn."""
        _, root = get_registry().get_root_units(self.quantity)
        return float(str(root._units.get("radian", 0)))

    @property
    def is_angular(self) -> bool:
        """Whether an angle is part of the unit."""
        return bool(self.radians)

    @cached_property
    def rotation(self) -> Rotation:
        """How the unit counts rotation. pint itself takes a cycle for a radian."""
        if any(name in TURNS for name, _ in self.powers):
            return Rotation.TURNS
        if self.is_angular:
            return Rotation.ANGLE
        return Rotation.CYCLES if any(name.endswith("hertz") for name, _ in self.powers) else Rotation.NONE


def get_registry() -> "pint.UnitRegistry[Any]":
    """Return the one registry of this process: pint does not mix units of two registries."""
    with _lock:
        return _build_registry()


@cache
def _build_registry() -> "pint.UnitRegistry[Any]":
    import pint

    return pint.UnitRegistry(cache_folder=None)


@lru_cache(maxsize=1024)
def read_unit(text: str) -> Unit:
    """Read a product of units and their powers: `N m/rad`, `kg·m²`, `1/s`, `m s^-1`. Raises InvalidAnswer."""
    folded = fold(text).replace(" squared", "^2").replace(" cubed", "^3")
    folded = PERCENT_APART.sub("percent", folded)
    folded = PREFIX_APART.sub(r"\1", POWER_BEFORE.sub(lambda match: f"{match[2]}^{POWERS[match[1]]}", folded))
    if len(folded) > CHARACTERS_MAX:
        raise InvalidAnswer(f"{quoted(text)} is too long to be a unit")
    powers: dict[str, int] = {}
    factors = _factors(folded)
    for symbol, power in [factor for factor in factors if factor[0].lower() not in COUNTED] or factors:
        *first, last = JOINED.get(symbol, (symbol,))
        sign = 1 if power > 0 else -1
        for part, part_power in (*((part, sign) for part in first), (last, power)):
            name = look_up(part)
            powers[name] = powers.get(name, 0) + part_power
    named = tuple((name, power) for name, power in powers.items() if power)
    if named != tuple((name, 1) for name, _ in named[:1]):
        named = tuple((f"delta_{name}" if name in SCALES_WITH_OFFSET else name, power) for name, power in named)
    return Unit(text.strip(), named)


def _factors(text: str) -> list[tuple[str, int]]:
    """List the symbols of a product and their powers, with parentheses resolved. Raises InvalidAnswer."""
    factors: list[tuple[str, int]] = []
    group_start: int | None = None
    group_sign = 1
    position = 1 if text.startswith(("1/", "1 /")) else 0
    while position < len(text) or not factors:
        match = FACTOR.match(text, position)
        is_joined = match and (match["over"] or bool(match["times"]) is bool(factors))
        if not match or not is_joined or (match["open"] and group_start is not None):
            raise InvalidAnswer(f"{quoted(text)} cannot be read as a unit")
        position = match.end()
        sign = -1 if match["over"] else 1
        if match["open"]:
            group_start, group_sign, sign = len(factors), sign, 1
        factors.append((match["name"], sign * group_sign * int(match["power"] or 1)))
        if match["close"]:
            if group_start is None:
                raise InvalidAnswer(f"{quoted(text)} closes a parenthesis that was not opened")
            power = int(match["group_power"] or 1)
            factors[group_start:] = [(name, power * own) for name, own in factors[group_start:]]
            group_start, group_sign = None, 1
    if group_start is not None:
        raise InvalidAnswer(f"{quoted(text)} leaves a parenthesis open")
    return factors


def look_up(name: str) -> str:
    """Find the full name of the unit with this symbol or name. Raises InvalidAnswer where there is none."""
    if name in TWO_MEANINGS:
        raise InvalidAnswer(f"The unit {quoted(name)} can mean {TWO_MEANINGS[name]}")
    if spelled := SPELLINGS.get(name) or IN_ANY_CASE.get(name.lower()) or COMMON.get(name):
        return spelled
    from pint import PintError

    for candidate in (name, name.lower()) if len(name) > 3 else (name,):
        try:
            full_name = get_registry().get_name(candidate)
        except PintError:  # unknown, or a prefix before a temperature
            continue
        if full_name and not full_name.endswith(LOGARITHMIC):
            return full_name
    raise InvalidAnswer(f"The unit {quoted(name)} is not known{suggest_unit(name)}")


def suggest_unit(name: str) -> str:
    """Returns a question after the unit that was probably meant, in brackets; empty if none is near."""
    similar = get_close_matches(name.lower(), SUGGESTED, n=1, cutoff=SIMILARITY_MIN) if len(name) > 3 else []
    return f" (did you mean {similar[0].replace('_', ' ')}?)" if similar else ""


def write_symbols(powers: Powers) -> str:
    """Write powers of units as `N·m/rad`, in their order."""
    over = [_symbol(name, power) for name, power in powers if power > 0]
    under = [_symbol(name, -power) for name, power in powers if power < 0]
    return "/".join(["·".join(over) or "1", *under])


def _symbol(name: str, power: int) -> str:
    # Pint 0.26, which needs Python 3.12, writes micro as a Greek letter; 0.25 as a sign of its own.
    symbol = str(get_registry().get_symbol(name)).replace("\u03bc", "\u00b5")
    return symbol if power == 1 else f"{symbol}^{power}"


@lru_cache(maxsize=1024)
def known_unit(text: str) -> Unit | None:
    """Read an author's unit; None for a word that only labels what is counted (`steps`)."""
    try:
        return read_unit(without_markup(text))
    except InvalidAnswer:
        return None


def convert(value: float, given: Unit, wanted: Unit) -> float:
    """Convert a value to another unit. Raises InvalidAnswer where the units measure different things."""
    if dict(given.powers) == dict(wanted.powers):
        return value
    if (known := COMMON_FACTORS.get((given.powers, wanted.powers))) is not None:
        return value * known
    from pint import PintError

    try:
        factor = _find_factor(given, wanted)
        converted: float = _convert_with_pint(value, given, wanted) if factor is None else value * factor
    except (PintError, OverflowError, ZeroDivisionError) as error:
        case = " (small and capital letters differ)" if given.text.casefold() == wanted.text.casefold() else ""
        raise InvalidAnswer(f"{quoted(given.text)} does not measure what is asked{case}") from error
    is_speed = given.powers == PER_MINUTE and wanted.rotation is Rotation.ANGLE
    if is_speed or {given.rotation, wanted.rotation} in UNCLEAR:
        raise InvalidAnswer(f"{quoted(given.text)} counts rotation in another way than is asked")
    if given.rotation is Rotation.TURNS and wanted.rotation is Rotation.CYCLES:
        converted /= math.tau**given.radians
    if given.rotation is Rotation.CYCLES and wanted.rotation is Rotation.TURNS:
        converted *= math.tau**wanted.radians
    return converted


@lru_cache(maxsize=1024)
def _find_factor(given: Unit, wanted: Unit) -> float | None:
    """The factor between two units; None between scales of temperature, which have an offset. It is what pint itself
    multiplies by, and takes pint fifty times as long to find as to use. Raises what pint raises."""
    return None if _convert_with_pint(0.0, given, wanted) else _convert_with_pint(1.0, given, wanted)


def _convert_with_pint(value: float, given: Unit, wanted: Unit) -> float:
    return float(get_registry().Quantity(value, given.quantity).to(wanted.quantity).magnitude)


def from_base_units(value: float, wanted: Unit) -> float:
    """Convert a value from base units (s, m, kg, rad, ...) to another unit of the same kind. Raises InvalidAnswer."""
    return convert(value, find_base_unit(wanted), wanted)


@lru_cache(maxsize=1024)
def find_base_unit(unit: Unit) -> Unit:
    """The unit of the same kind in base units."""
    base: Any = get_registry().get_root_units(unit.quantity)[1]
    return Unit(str(base), tuple(base._units.items()))
