"""Numbers and units as people type them."""

import math
from typing import Any

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from grader.domain.verdict import Status
from grader.errors import InvalidAnswer
from grader.questions import grade_answer, read_answer
from grader.questions.kinds.number import NumberQuestion
from grader.questions.kinds.number.numbers import TypedNumber
from grader.questions.kinds.number.numbers import read_number as read_folded
from grader.questions.kinds.number.quantities import CHARACTERS_MAX, read_quantity
from grader.questions.kinds.number.spelling import fold
from grader.questions.kinds.number.unit_names import COMMON
from grader.questions.kinds.number.units import get_registry


def read_number(text: str) -> TypedNumber:
    return read_folded(fold(text))


FIVE_MS = NumberQuestion(id="q2", kind="numeric", q="How long?", answer=5, tol=0.05, unit="ms")


@pytest.mark.parametrize(
    "text",
    [
        "5", "5.", "5.0", "+5", "05", "5,0", "5 ms", "5ms", "5 ms.", "5 msec", "5 milliseconds", "5\u00a0ms",
        "0.005 s", "0,005 s", ".005 s", ",005 s", "5e-3 s", "5×10^-3 s", "5·10⁻³ s", "5*10**-3 s", "5\u202fms",
        "5 ⋅ 10^(-3) s", "5 × 10⁻³ seconds", "0.5·10^−2 s", "5000 µs", "5000 μs", "5000 us", "5 000 µs", "5'000 µs",
        "1/200 s", "10/2", "h = 5 ms", "= 5", "≈ 5 ms", "t_max=0.005 s", "５ ms", "0.00505 s", "0.00495 s",
        "8.3333e-5 min", "5 x 10^-3 s",
        5, 5.0, 5.05, 4.95,
    ],
)  # fmt: skip
def test_five_milliseconds(text: Any) -> None:
    assert grade_answer(FIVE_MS, text).status is Status.CORRECT


@pytest.mark.parametrize(
    "text", ["-5", "−5", "–5 ms", "- 5 ms", "5.0501", "4.9499 ms", "0.005", "0,005", "5 s", 0, -5, "1e300"]
)
def test_not_five_milliseconds(text: Any) -> None:
    assert grade_answer(FIVE_MS, text).status is Status.INCORRECT


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "empty"),
        (" \u00a0 ", "empty"),
        ("five", "does not begin with a number"),
        ("--5", "does not begin with a number"),
        ("ms", "does not begin with a number"),
        ("nan", "not a finite number"),
        ("-Infinity", "not a finite number"),
        ("∞ ms", "not a finite number"),
        ("1e999", "too large"),
        ("1e308 h", "too large"),
        ("1e-999", "too small"),
        ("5 kg", '"kg" does not measure what is asked: type one number in ms'),
        ("5 MS", "small and capital letters differ"),
        ("5 m s", '"m s" does not measure what is asked: type one number in ms'),
        ("5 parsnips", "not known"),
        ("1,234", 'can mean "1.234" or "1234"'),
        ("1,234 ms", 'can mean "1.234 ms" or "1234 ms"'),
        ("12,345e3", 'can mean "12.345e3" or "12345e3"'),
        ("[5,6]", 'can mean "5.6" or an interval: type one number'),
        ("(0,5)", 'can mean "0.5" or an interval: type one number'),
        ("1,23,456", "cannot be read as one number"),
        ("5 5", "cannot be read as one number"),
        ("1.2.3", "cannot be read as one number"),
        ("5,", "cannot be read as one number"),
        ("< 5 ms", "bound or a range"),
        ("5 ± 0.1 ms", "bound or a range"),
        ("1/0 s", "divides by zero"),
        ("2**99999", "is a calculation: type its result in ms"),
        ("9" * (CHARACTERS_MAX + 1), "too long"),
        ("5 ms (Euler)", 'The unit "Euler" is not known: type one number in ms'),
        ("5 - 6 ms", "is a range or a calculation: type one number in ms"),
        ("0x10", "cannot be read as a unit: type one number in ms"),
        ("5 __import__('os')", "cannot be read as a unit: type one number in ms"),
        (True, "number in ms"),
        (None, "number in ms"),
        ([5], "number in ms"),
        ({"value": 5}, "number in ms"),
        (math.nan, "not a finite number"),
        (-math.inf, "too large"),
        (10**400, "too large"),
    ],
)
def test_what_cannot_be_read_is_told_why(text: Any, why: str) -> None:
    verdict = grade_answer(FIVE_MS, text)
    assert verdict.status is Status.INVALID_ANSWER
    assert verdict.diagnosis is not None and why in verdict.diagnosis, verdict.diagnosis


@pytest.mark.parametrize(
    ("text", "unit", "read_as"),
    [
        ("0.005 s", "ms", "5 ms"),
        ("0.005", "ms", "0.005 ms"),
        ("20 000", "N m/rad", "20000 N m/rad"),
        ("20 000 N·m/rad", "N m/rad", "20000 N m/rad"),
        ("20 kN m", "N m/rad", "20000 N m/rad"),
        ("5 Nm", "N m", "5 N m"),
        ("5 J", "N m", "5 N m"),
        ("1.234,5", "mm", "1234.5 mm"),
        ("1,234.5", "mm", "1234.5 mm"),
        ("1,234,567", "mm", "1234567 mm"),
        ("1.234.567", "mm", "1234567 mm"),
        ("1234,567", "mm", "1234.567 mm"),
        ("9.81 m/s2", "m/s<sup>2</sup>", "9.81 m/s^2"),
        ("9.81 m s⁻²", "$m/s^{2}$", "9.81 m/s^2"),
        ("2501 g cm²", "kg m²", "0.0002501 kg m²"),
        ("0.25 kg*m^2", "kg·m²", "0.25 kg·m²"),
        ("pi/2", "rad", "1.5708 rad"),
        ("2π rad", "deg", "360 deg"),
        ("90°", "rad", "1.5708 rad"),
        ("60 rpm", "rad/s", "6.28319 rad/s"),
        ("2 rev", "deg", "720 deg"),
        ("20 °C", "K", "293.15 K"),
        ("293.15 K", "°C", "20 °C"),
        ("1 kHz", "1/s", "1000 1/s"),
        ("5 /s", "Hz", "5 Hz"),
        ("5 s/(s ms)", "1/s", "5000 1/s"),
        ("½ s", "ms", "500 ms"),
        ("2 K/m", "°C/m", "2 °C/m"),
        ("5 %", None, "0.05"),
        ("0.05", None, "0.05"),
        ("5", "%", "5 %"),
        ("5 %", "%", "5 %"),
        ("5 Steps", "steps", "5 steps"),
        ("5", "steps", "5 steps"),
        (1e-7, "m", "1e-07 m"),
    ],
)
def test_read_as(text: Any, unit: str | None, read_as: str) -> None:
    question = NumberQuestion(id="q", kind="numeric", q="How much?", answer=1, unit=unit)
    assert read_answer(question, text) == read_as


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        ("5 ms", None),
        ("90 deg", None),
        ("5 ms", "steps"),
        ("1 Hz", "rad/s"),
        ("60 rpm", "1/s"),
        ("1 degC m", "K"),
        ("5 m", ""),
    ],
)
def test_units_that_do_not_fit(text: str, unit: str | None) -> None:
    with pytest.raises(InvalidAnswer):
        read_quantity(text, unit)


def test_two_percent_where_no_tolerance_is_given() -> None:
    question = NumberQuestion(id="q", kind="numeric", q="How much?", answer=-50)
    assert [grade_answer(question, x).status for x in (-49, -51, -48.999, -51.001)] == [
        Status.CORRECT, Status.CORRECT, Status.INCORRECT, Status.INCORRECT,
    ]  # fmt: skip


def test_an_integer_beyond_every_float_is_too_large() -> None:
    assert grade_answer(FIVE_MS, 10**5000).diagnosis == "The number is too large: type a finite number in ms."


def test_no_tolerance_at_all_still_forgives_the_rounding_of_a_conversion() -> None:
    question = NumberQuestion(id="q", kind="numeric", q="How long?", answer=0.3, tol=0, unit="s")
    assert grade_answer(question, "300000 µs").status is Status.CORRECT
    assert grade_answer(question, "300000.000001 µs").status is Status.INCORRECT


finite_floats = st.floats(allow_nan=False, allow_infinity=False)
digits = st.integers(0, 999)


@given(finite_floats)
def test_every_float_is_read_back_exactly(value: float) -> None:
    assert read_number(repr(value)).value == value
    assert read_quantity(value, "ms").value == value


@given(
    st.floats(-1e9, 1e9, allow_nan=False),
    st.sampled_from(["s", "ms", "µs", "min", "h"]),
    st.sampled_from(["s", "ms", "µs"]),
)
def test_there_and_back_between_units(value: float, there: str, back: str) -> None:
    first = read_quantity(f"{value!r} {there}", back).value
    assume(first == 0 or abs(first) > 1e-290)
    assert math.isclose(read_quantity(f"{first!r} {back}", there).value, value, rel_tol=1e-14, abs_tol=1e-290)


@given(st.integers(0, 10**6), st.integers(1, 10**6).map(str))
def test_a_decimal_comma_is_a_decimal_point_or_refused(whole: int, fraction: str) -> None:
    text = f"{whole},{fraction}"
    if 0 < whole < 1000 and len(fraction) == 3:
        with pytest.raises(InvalidAnswer, match="can mean"):
            read_number(text)
    else:
        assert read_number(text).value == float(f"{whole}.{fraction}")


@given(st.integers(10**6, 10**15), st.sampled_from([",", ".", " ", "'", "\u202f", "\u2009", "_"]))
def test_groups_of_three_digits(value: int, separator: str) -> None:
    assert read_number(f"{value:,}".replace(",", separator)).value == value


@given(st.integers(-99999, 99999), st.integers(-30, 30))
def test_every_way_to_write_a_power_of_ten(mantissa: int, power: int) -> None:
    raised = str(power).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
    minus = str(mantissa).replace("-", "−")
    for text in (f"{mantissa}e{power}", f"{mantissa}×10^{power}", f"{minus} · 10{raised}", f"{mantissa} * 10**{power}"):
        assert read_number(text).value == float(f"{mantissa}e{power}")


@settings(max_examples=300)
@given(
    st.text(st.characters(exclude_categories=()), max_size=120)
    | st.text("0123456789.,'eE+-−×·*^/() πpimskNrad°%½²⁻", max_size=30)
)
def test_any_text_is_read_or_refused_with_one_sentence(text: str) -> None:
    try:
        value = read_quantity(text, "rad/s").value
    except InvalidAnswer as error:
        assert str(error).endswith(".")
        assert str(error).isprintable()
    else:
        assert math.isfinite(value)


@pytest.mark.parametrize(("name", "full_name"), COMMON.items())
def test_a_common_unit_is_what_pint_reads(name: str, full_name: str) -> None:
    assert get_registry().get_name(name) == full_name


def test_a_number_that_its_unit_makes_too_large_is_refused_in_one_sentence() -> None:
    with pytest.raises(InvalidAnswer) as refused:
        read_quantity("1e308 ks", "s")
    assert str(refused.value) == '"1e+308 ks" is too large: type a finite number in s.'
