"""What holds for every typed answer: round trips, dimensions, and the time that reading takes."""

import math
import re
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from grader.domain.pages.markup import plain_text, quoted
from grader.errors import InvalidAnswer
from grader.questions.kinds.choice import options
from grader.questions.kinds.number import numbers, quantities, spelling, units
from grader.questions.kinds.number.quantities import Quantity, read_quantity

UNITS_BY_DIMENSION = {
    "time": ["s", "ms", "µs", "min", "h"],
    "length": ["m", "mm", "cm", "km"],
    "mass": ["kg", "g", "mg"],
    "frequency": ["Hz", "kHz"],
    "force": ["N", "kN", "mN"],
    "torque": ["N m", "Nm", "kNm", "J"],
    "inertia": ["kg m^2", "kg·m²", "kgm2", "g cm^2", "kg*m**2"],
    "stiffness": ["N/m", "kN/m", "N m^-1"],
    "speed": ["m/s", "km/h", "mm/s"],
    "acceleration": ["m/s^2", "m s⁻²", "m/s<sup>2</sup>", "$m/s^{2}$"],
    "power": ["W", "kW", "mW"],
    "temperature": ["K", "°C"],
}
UNITS = [unit for group in UNITS_BY_DIMENSION.values() for unit in group] + [
    "rad",
    "deg",
    "rad/s",
    "rpm",
    "%",
    "steps",
]
PAIRS = st.tuples(st.sampled_from(sorted(UNITS_BY_DIMENSION)), st.sampled_from(sorted(UNITS_BY_DIMENSION)))
finite = st.floats(-1e12, 1e12).filter(lambda value: value == 0 or abs(value) > 1e-12)
FRAMES = [
    "{}", "h = {}", "h < {}", "Δt ≈ {}", "about {}", "ca. {}", "({})", "**{}**", "<b>{}</b>", "  {}  ", "\u200f{}",
    "$h = ${}", "<p>{}</p>",
]  # fmt: skip
SCRIPTS = ["0123456789", "٠١٢٣٤٥٦٧٨٩", "۰۱۲۳۴۵۶۷۸۹", "०१२३४५६७८९", "０１２３４５６７８９", "০১২৩৪৫৬৭৮৯", "๐๑๒๓๔๕๖๗๘๙"]


@given(finite, st.sampled_from(UNITS), st.sampled_from(FRAMES))
def test_what_is_printed_is_read_back(value: float, unit: str, frame: str) -> None:
    shown = str(Quantity(value, value, None, spelling.without_markup(unit)))
    assert read_quantity(frame.format(shown), unit).value == pytest.approx(value, rel=5e-6)  # six digits are shown


@given(finite, st.sampled_from(SCRIPTS), st.sampled_from(["ms", "N m/rad", None]))
def test_the_digits_of_every_script_are_read(value: float, script: str, unit: str | None) -> None:
    typed = f"{value!r} {unit or ''}".translate(str.maketrans("0123456789", script))
    assert read_quantity(typed, unit).value == value


@settings(max_examples=300)
@given(finite, PAIRS, st.data(), st.sampled_from(FRAMES))
def test_another_dimension_is_never_accepted(value: float, pair: tuple[str, str], data: Any, frame: str) -> None:
    typed, wanted = (data.draw(st.sampled_from(UNITS_BY_DIMENSION[name])) for name in pair)
    answer = frame.format(f"{value!r} {spelling.without_markup(typed)}")
    if pair[0] == pair[1]:
        assert math.isfinite(read_quantity(answer, wanted).value)
    else:
        with pytest.raises(InvalidAnswer, match=f" in {re.escape(spelling.without_markup(wanted))}\\.$"):
            read_quantity(answer, wanted)


@given(finite, finite)
def test_two_values_are_one_answer_only_where_they_agree(first: float, second: float) -> None:
    text = f"{first!r} ms = {second!r} ms"
    if abs(first - second) <= quantities.AGREEMENT * max(abs(first), abs(second)):
        assert read_quantity(text, "ms").value == second
    else:
        with pytest.raises(InvalidAnswer, match="gives two answers"):
            read_quantity(text, "ms")


@given(st.integers(1, 999), st.integers(0, 999), st.sampled_from(["", "-"]), st.sampled_from(["", " ms", " s", "e3"]))
def test_either_reading_of_a_comma_that_is_offered_is_clear(whole: int, part: int, sign: str, rest: str) -> None:
    with pytest.raises(InvalidAnswer) as refusal:
        read_quantity(f"{sign}{whole},{part:03}{rest}", "ms")
    offered = re.findall(r'"([^"]*)"', str(refusal.value))[1:]
    assert offered == [f"{sign}{whole}.{part:03}{rest}", f"{sign}{whole}{part:03}{rest}"]
    point, none = (read_quantity(text, "ms").number for text in offered)
    assert none == pytest.approx(1000 * point)


def read_whole_unit(text: str) -> None:
    """The factors of a unit, without the limit on its length and without pint."""
    units._factors(text)


RULES: dict[str, Callable[[str], object]] = {
    "fold": spelling.fold,
    "without_markup": spelling.without_markup,
    "plain_text": plain_text,
    "quoted": quoted,
    "sides": quantities.sides,
    "unwrapped": quantities.unwrap,
    "without hedge": quantities._without_hedge,
    "formula": quantities.FORMULA.fullmatch,
    "again": lambda text: quantities.AGAIN.sub("=", quantities.AGAIN_IN_PARENTHESES.sub(r"=\1", text)),
    "read_number": numbers.read_number,
    "unreadable": lambda text: numbers.build_refusal(text, text, "no"),
    "units": read_whole_unit,
    "index": options.INDEX.fullmatch,
    "whole answer": lambda text: read_quantity(text, "ms"),
}
WORST = [
    "9", "1,", "1.", "1 ", "1'", " ", "(", ")", "((5", "<", "<b", "<b>", "<!--", "&", "&lt;", "$", "\\", "{", "}",
    "^", "^{", "\\frac{", "\\frac{1}{", "\\frac{1}{2}", "_{", "=", "h =", "h <", "5=", "about ", "ca.", "m ", "m*",
    "m/", "(m ", "m2", "kg-", "per ", "m^(", "10^", "10^(", "*10", " 10", "e3", "π", "pi/", "/1", "1/", "- 1", "to 1",
    "½", "⁻³", "٥", "\u200b", "the ", "max ", "a", "a_", "[", "*", "\"", "!", ".", "~", " squared", "sqrt(", "x 10-",
    "\ud800", "é", "é",
]  # fmt: skip
SMALL, LARGE = 16_384, 65_536
GROWTH_MAX = 10
"""Four times the text takes four times as long if the rule is linear, and 16 times if it is quadratic."""

QUICK_S = 0.05
"""CPU time in which the longer text is too quick for a quadratic rule: 64 KB copied 64 K times take 0.2 s."""


def seconds(rule: Callable[[str], object], text: str) -> float:
    """CPU time of this thread."""
    start = time.thread_time()
    with suppress(InvalidAnswer):
        rule(text)
    return time.thread_time() - start


@pytest.mark.cost
@pytest.mark.parametrize("name", RULES)
def test_every_rule_takes_linear_time(name: str) -> None:
    rule = RULES[name]
    for piece in WORST:
        for head, tail in (("", ""), ("5 ", "?"), ("5", "\x01")):
            small, large = (head + piece * (size // len(piece)) + tail for size in (SMALL, LARGE))
            if seconds(rule, large) > QUICK_S:
                took = min(seconds(rule, large) for _ in range(3))
                assert took < GROWTH_MAX * min(seconds(rule, small) for _ in range(3)), (piece, head)
