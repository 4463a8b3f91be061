"""Known slips are named; the right number is not given away."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grader.questions import grade_answer
from grader.questions.kinds.number import NumberQuestion


def diagnosis(answer: float, unit: str | None, given: Any, tol: float | None = None) -> str | None:
    question = NumberQuestion(id="q", kind="numeric", q="How much?", answer=answer, tol=tol, unit=unit)
    return grade_answer(question, given).diagnosis


def test_seconds_for_milliseconds() -> None:
    told = diagnosis(5, "ms", "0.005", 0.05)
    assert told == (
        "Your number would be right in seconds (s), but milliseconds (ms) were asked for: "
        "convert it, or type its unit as well."
    )


@pytest.mark.parametrize(
    ("answer", "unit", "given", "told"),
    [
        (5, "ms", "5000", "right in microseconds (µs), but milliseconds (ms) were asked for"),
        (5, "ms", "5 s", "right in milliseconds (ms), but you wrote seconds (s): correct the unit or the number"),
        (120, "s", "2", "right in minutes (min), but seconds (s) were asked for"),
        (3.14159, "rad", "180", "right in degrees (deg), but radians (rad) were asked for"),
        (180, "deg", "3.1416", "right in radians (rad), but degrees (deg) were asked for"),
        (1.5, "rad/s", "85.94", "right in deg/s, but rad/s was asked for"),
        (20000, "N m/rad", "20", "right in kN·m/rad, but N m/rad was asked for"),
        (293.15, "K", "20", "right in degrees Celsius (°C), but kelvins (K) were asked for"),
        (5, "ms", "-5", "has the wrong sign: check whether it can be negative at all, and which direction counts"),
        (5, "ms", "10", "off by a factor of two"),
        (5, "ms", "2.5", "off by a factor of two"),
        (5, "ms", "50", "off by a power of ten (a factor of 10)"),
        (7, None, "7e-3", "off by a power of ten (a factor of 1000)"),
        (0.5, None, "28.65", "mixes up degrees and radians"),
        (4, None, "0.25", "is the reciprocal"),
        (5, "ms", "200", "is the reciprocal"),
        (5, "ms", "0.2", "is the reciprocal"),
        (
            10,
            None,
            "0.1",
            "off by a power of ten (a factor of 100), or is the reciprocal of what is asked: check the exponents",
        ),
        (5, "ms", "-0.005", "has the wrong sign and is off by a power of ten (a factor of 1000)"),
        (5, "ms", "-2.5", "has the wrong sign and is off by a factor of two"),
        (5, "ms", "0.01", "is off by a factor of 500: look for a factor that is missing"),
        (5, "ms", "1", "is off by a factor of 5: look"),
        (5, "ms", "100", "is off by a factor of 20: look"),
        (5, "ms", "0.1", "is off by a factor of 50: look"),
        (19.62, "N", "2", "is off by a factor of about 9.8: look for gravity, 9.81 m/s², or pi²"),
        (58.86, "J", "577", "is off by a factor of about 9.8"),
        (9.8696, "N/m", "1", "is off by a factor of about 9.8"),
        (4.905, "m", "1", "is off by a factor of about 4.9 or 19.6"),
        (19.62, "N", "196.2", "is off by a power of ten (a factor of 10): check"),
        (10, "rad/s", "100", "is off by a power of ten (a factor of 10), or is the square of what is asked"),
        (20, "rad/s", "400", "is the square of what is asked: look for a square root that is missing"),
        (1.5, None, "1.2247", "is the square root of what is asked"),
        (1.5915, "Hz", "10", "is off by a factor of 2 pi: frequency in Hz and angular frequency in rad/s differ by it"),
        (10, "rad/s", "1.5915", "would be right in turn/s, but rad/s was asked for"),
        (10, "rad/s", "62.83", "is off by a factor of 2 pi: frequency in Hz and angular frequency in rad/s differ"),
        (0.6283, "s", "10", "is 2 pi over what is asked: period and angular frequency are 2 pi over each other"),
        (628.3, "ms", "10", "is 2 pi over what is asked: period"),
        (20, "rad/s", "0.31416", "is 2 pi over what is asked: period"),
        (1.2566, "s", "0.2", "is off by a factor of 2 pi: a period is 2 pi over the angular frequency"),
        (20, "rad/s", "190.986", "would be right in revolutions per minute: 1 rpm is 2 pi/60 rad/s"),
        (190.986, "rpm", "20", "would be right in radians per second: 1 rad/s is 60/(2 pi) rpm"),
    ],
)
def test_known_slips(answer: float, unit: str | None, given: str, told: str) -> None:
    message = diagnosis(answer, unit, given)
    assert message is not None and told in message, message


@pytest.mark.parametrize(
    ("answer", "unit", "given"), [(5, "ms", "7"), (5, "ms", "0"), (0, "ms", "1"), (5, "ms", "1e300"), (5, None, "13")]
)
def test_no_known_slip(answer: float, unit: str | None, given: str) -> None:
    assert diagnosis(answer, unit, given) is None


@pytest.mark.parametrize(
    ("answer", "given", "told"),
    [
        (2.963, "2.095", None),  # 2 pi over it is 2.999, within the tolerance of 2 % by chance
        (2.963, "2.121", "is 2 pi over what is asked"),
        (2.963, "2.1", "is 2 pi over what is asked"),
        (3.0, "2.095", "is 2 pi over what is asked"),
    ],
)
def test_a_slip_matches_as_far_as_the_digits_go(answer: float, given: str, told: str | None) -> None:
    seen = diagnosis(answer, "rad/s", given, 0.02 * answer)
    assert told in seen if seen and told else seen == told


def test_a_broad_tolerance_makes_every_slip_a_guess() -> None:
    assert diagnosis(5, "ms", "50", tol=2) is None


def test_a_right_number_is_no_slip() -> None:
    assert diagnosis(1, None, "1") is None


UNITS = [
    "ms",
    "K",
    "°C",
    "°C/m",
    "1/degC",
    "dB",
    "Np",
    "%",
    "mpg",
    "Hz",
    "rad",
    "rpm",
    "N m/rad",
    "degF^2",
    "pH",
    "$",
    "",
    None,
]
TYPED = ["5", "-3", "1e308", "5e-324", "5 °C", "0 degF", "-3 dB", "5 %", "1e308 s", "5 1/K", "1e-320 s", "1e200 km^9"]


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("answer", [5, -5, 0, 1e100, -1e-100])
def test_no_unit_breaks_the_search_for_a_slip(answer: float, unit: str | None) -> None:
    for given_text in TYPED:
        told = diagnosis(answer, unit, given_text)
        assert told is None or told.endswith(".")


@given(
    st.floats(1e-6, 1e6).map(lambda x: float(f"{x:.3g}")),
    st.sampled_from([-1.0, 2.0, 0.5, 10.0, 1e3, 1e-3, -1e3, -2.0]),
    st.sampled_from(["ms", "N m/rad", None]),
)
def test_a_slip_is_always_told_and_never_gives_the_number_away(answer: float, factor: float, unit: str | None) -> None:
    question = NumberQuestion(id="q", kind="numeric", q="How much?", answer=answer, unit=unit, explain=None)
    verdict = grade_answer(question, answer * factor)
    assert verdict.diagnosis is not None
    assert [finding.expected for finding in verdict.findings] == [answer], "which redaction holds back"
    assert f"{answer:g} " not in verdict.diagnosis or f"{answer:g}" in ("10", "100", "1000")


@pytest.mark.parametrize("given", ["-5", "10", "50", "-50", "200", "0.005", "5 s", "-2.5", "0.01"])
def test_first_what_was_seen_then_what_to_do(given: str) -> None:
    told = diagnosis(5, "ms", given)
    assert told is not None and told.startswith("Your number ")
    seen, cure = told.split(": ")
    assert seen and cure.split()[0] in {"check", "look", "convert", "correct", "swap"}
