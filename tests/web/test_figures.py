"""How numbers are written for people."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grader.web.text.numbers import keep_unbroken, remark, write_number, write_points, write_quantity

WRITTEN = {0.0: "0", -2.5: "−2.5", 1 / 3: "0.3333", 1e-11: "10⁻¹¹", -2.5e7: "−2.5·10⁷", math.inf: "∞", 120: "120"}


@pytest.mark.parametrize("value", WRITTEN)
def test_numbers_are_written_for_people(value: float) -> None:
    assert write_number(value) == WRITTEN[value]


def test_what_is_no_number() -> None:
    assert write_number(None) == "–"
    assert write_number(math.nan) == "not a number"


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_a_number_reads_back_to_its_figures(value: float) -> None:
    figures = write_number(value).replace("−", "-").translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789"))
    assert len(write_number(value)) <= 14
    if "·" not in write_number(value) and "10" not in figures:
        assert float(figures) == pytest.approx(value, rel=6e-4)


def test_a_unit_stays_on_the_line_of_its_number() -> None:
    assert write_quantity(22.0521, "ms") == "22.05\u202fms"
    assert keep_unbroken("from 22.05 to 22.44 ms, -3 rad") == "from 22.05 to 22.44\u202fms, −3\u202frad"
    assert keep_unbroken("3 cases of 5 messages, a-3, 2026-11-21") == "3 cases of 5 messages, a-3, 2026-11-21"


def test_a_remark_is_a_sentence_and_its_names_are_code() -> None:
    assert remark("no key: add a `verify` <b>") == "No key: add a <code>verify</code> &lt;b&gt;"
    assert remark("kp = 5") == "kp = 5"


def test_points_have_at_most_two_decimals() -> None:
    assert [write_points(value) for value in (0.0, 1.0, 1.2222, 10.5)] == ["0", "1", "1.22", "10.5"]
