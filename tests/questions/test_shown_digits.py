"""How a typed number is told again: six digits, and more where it was typed with more."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grader.questions.kinds.number.quantities import format_number, read_quantity

UNITS = [("deg/s", "rad/s"), ("mm", "m"), ("ms", "s"), ("J", "J"), ("rpm", "rad/s")]


@pytest.mark.parametrize(
    ("typed", "unit", "text"),
    [
        ("125.5 deg/s", "rad/s", "2.19039 rad/s"),
        ("1/3 m", "m", "0.333333 m"),
        ("0.005 s", "ms", "5 ms"),
        ("2.19038821", "rad/s", "2.19038821 rad/s"),
        (1000000.5, "mm", "1000000.5 mm"),
        ("0.1*3", "m", "0.3 m"),
    ],
)
def test_a_number_is_told_with_six_digits_or_as_many_as_were_typed(typed: str | float, unit: str, text: str) -> None:
    assert read_quantity(typed, unit).text == text


@given(st.sampled_from(UNITS), st.integers(3, 10), st.data())
def test_numbers_that_were_typed_with_other_digits_look_different(
    units: tuple[str, str], digits: int, data: st.DataObject
) -> None:
    low, high = 10 ** (digits - 1), 10**digits - 1
    first, second = (data.draw(st.integers(low, high)) for _ in range(2))
    told = {read_quantity(f"{number / 100:.2f} {units[0]}", units[1]).text for number in (first, second)}
    assert len(told) == (1 if first == second else 2)


@given(st.floats(1e-6, 1e6), st.floats(1e-11, 1e-3))
def test_two_values_that_differ_are_never_told_alike(value: float, share: float) -> None:
    other = value * (1 + share)
    assert format_number(value, other) != format_number(other, value)
    assert len(format_number(value).replace(".", "").partition("e")[0].strip("0")) <= 6
