"""Units as people type them, read name by name: no text is ever evaluated as an expression."""

import html
import re
import threading
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache
from typing import Any

import pint
from pint.util import UnitsContainer

from grader.errors import InvalidAnswer
from grader.grading.numbers import fold, quoted

CHARACTERS_MAX = 60
"""Longer texts are no unit."""

_FACTOR = r"[A-Za-zμΩ°%_]+(?:(?:\^|\*\*)?\(?[+-]?[1-9]\)?)?"
_TIMES = r"(?: ?[*/] ?| )"
_GROUP = rf"\( ?{_FACTOR}(?:{_TIMES}{_FACTOR})* ?\)"
UNIT = re.compile(rf"(?:1? ?/ ?)?(?:{_FACTOR}|{_GROUP})(?:{_TIMES}(?:{_FACTOR}|{_GROUP}))*")
TOKEN = re.compile(r"(?P<name>[A-Za-zμΩ°%_]+)(?:\^|\*\*)?\(?(?P<power>[+-]?[1-9])?\)?|(?P<mark>[/()])")

SPELLINGS: Mapping[str, Mapping[str, int]] = {
    "°": {"degree": 1},
    "°C": {"degree_Celsius": 1},
    "°F": {"degree_Fahrenheit": 1},
    "rev": {"turn": 1},
    "revs": {"turn": 1},
    "Nm": {"newton": 1, "meter": 1},
    "Nms": {"newton": 1, "meter": 1, "second": 1},
    "kgm": {"kilogram": 1, "meter": 1},
}
"""What pint reads as something else (`Nm` as a textile's number), or not at all."""

SCALES_WITH_OFFSET = ("degree_Celsius", "degree_Fahrenheit", "degree_Reaumur")
"""In a product they are differences of temperature: a kelvin per metre is a degree Celsius per metre."""

LOGARITHMIC = ("bel", "neper", "decade", "octave", "decibelwatt", "decibelmilliwatt", "decibelmicrowatt")
"""Levels: not converted, because a negative ratio has none."""

SAME_IN_PLURAL = ("hertz", "siemens", "Celsius", "Fahrenheit", "percent", "lux")

_lock = threading.Lock()


@dataclass(frozen=True)
class Unit:
    """A unit known to pint: how it was written, and the power of every named unit in it."""

    text: str
    powers: tuple[tuple[str, int], ...]

    @cached_property
    def quantity(self) -> pint.Unit:
        """For pint's conversions."""
        return registry().Unit(UnitsContainer(dict(self.powers)))

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
    def is_angular(self) -> bool:
        """Whether an angle is part of it: radians, degrees, turns; also hidden in rpm."""
        _, root = registry().get_root_units(self.quantity)
        return "radian" in root._units

    @property
    def counts_cycles(self) -> bool:
        """Whether it is a frequency, whose cycles pint does not tell from radians."""
        return any(name.endswith("hertz") for name, _ in self.powers)


def registry() -> "pint.UnitRegistry[Any]":
    """The one registry of this process: units of two registries do not mix."""
    with _lock:
        return _build_registry()


@cache
def _build_registry() -> "pint.UnitRegistry[Any]":
    return pint.UnitRegistry(cache_folder=None)


@lru_cache(maxsize=1024)
def read_unit(text: str) -> Unit:
    """A product of units and their powers: `N m/rad`, `kg·m²`, `1/s`, `m s^-1`. Raises InvalidAnswer."""
    folded = fold(text)
    if len(folded) > CHARACTERS_MAX or not UNIT.fullmatch(folded):
        raise InvalidAnswer(f"{quoted(text)} cannot be read as a unit.")
    powers: dict[str, int] = {}
    sign = group = 1
    for token in TOKEN.finditer(folded):
        if token["mark"] == "/":
            sign = -1
        elif token["mark"] == "(":
            group, sign = sign, 1
        elif token["mark"] == ")":
            group = 1
        else:
            for name, power in look_up(token["name"]).items():
                powers[name] = powers.get(name, 0) + sign * group * power * int(token["power"] or 1)
            sign = 1
    factors = tuple((name, power) for name, power in powers.items() if power)
    if factors != tuple((name, 1) for name, _ in factors[:1]):
        factors = tuple((f"delta_{name}" if name in SCALES_WITH_OFFSET else name, power) for name, power in factors)
    return Unit(text.strip(), factors)


def look_up(name: str) -> Mapping[str, int]:
    """The full names of the units that one name stands for. Raises InvalidAnswer where there are none."""
    if name in SPELLINGS:
        return SPELLINGS[name]
    for spelling in (name, name.lower()) if len(name) > 3 else (name,):
        try:
            full_name = registry().get_name(spelling)
        except pint.UndefinedUnitError:
            continue
        if full_name and not full_name.endswith(LOGARITHMIC):
            return {full_name: 1}
    raise InvalidAnswer(f"The unit {quoted(name)} is not known.")


def symbols(powers: tuple[tuple[str, int], ...]) -> str:
    """`N·m/rad`, in the order in which the powers stand."""
    over = [_symbol(name, power) for name, power in powers if power > 0]
    under = [_symbol(name, -power) for name, power in powers if power < 0]
    return "/".join(["·".join(over) or "1", *under])


def _symbol(name: str, power: int) -> str:
    symbol = str(registry().get_symbol(name))
    return symbol if power == 1 else f"{symbol}^{power}"


@lru_cache(maxsize=1024)
def known_unit(text: str) -> Unit | None:
    """An author's unit, HTML and TeX taken off; None for a word that only labels what is counted (`steps`)."""
    try:
        return read_unit(plain_unit(text))
    except InvalidAnswer:
        return None


def plain_unit(text: str) -> str:
    """An author's unit as plain text: `m/s<sup>2</sup>` and `$m/s^{2}$` as `m/s^2`."""
    text = html.unescape(re.sub(r"<[^<>]*>", "", text.replace("<sup>", "^")))
    text = text.replace(r"\cdot", "·").replace(r"\,", " ")
    return " ".join(re.sub(r"\\[a-z]+|[${}]", "", text).split())


def convert(value: float, given: Unit, wanted: Unit) -> float:
    """A value in another unit. Raises InvalidAnswer where the units measure different things."""
    if (given.counts_cycles and wanted.is_angular) or (given.is_angular and wanted.counts_cycles):
        raise InvalidAnswer(f"Cycles and angles are not the same: give the answer in {wanted.text}.")
    if dict(given.powers) == dict(wanted.powers):
        return value
    try:
        converted: float = registry().Quantity(value, given.quantity).to(wanted.quantity).magnitude
    except (pint.PintError, OverflowError, ZeroDivisionError) as error:
        case = "; small and capital letters differ" if given.text.casefold() == wanted.text.casefold() else ""
        raise InvalidAnswer(f"{quoted(given.text)} is not a unit of what is asked: use {wanted.text}{case}.") from error
    return converted


def from_base_units(value: float, wanted: Unit) -> float:
    """A value in base units (s, m, kg, rad, ...) in another unit of the same kind. Raises InvalidAnswer."""
    base: Any = registry().get_root_units(wanted.quantity)[1]
    return convert(value, Unit(str(base), tuple(base._units.items())), wanted)
