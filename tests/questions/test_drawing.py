"""Drawn numbers: the same for a seed, in their ranges, in every text, and told to the author where they cannot be."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from grader.questions import parse_question
from grader.questions.drawing import Drawable, draw_numbers, find_middle, list_corners, list_unknown_names

RAW: dict[str, Any] = {
    "id": "rest", "kind": "numeric", "answer": 2.0, "unit": "rad", "draw": {"kp": [500, 3000], "lean": [-2, -1]},
    "q": "With {kp} and $\\sqrt{kp}$ from {lean} rad, and {other}?",
    "verify": {
        "by": "measurement", "model": "pendulum", "setup": "data.qpos[0] = 1 - {lean}", "expr": "{kp}", "seconds": 1,
    },
}  # fmt: skip

finite = st.floats(-1e6, 1e6).filter(lambda value: value == 0 or abs(value) > 1e-6)
ranges = st.dictionaries(
    st.sampled_from(["a", "b", "c"]), st.tuples(finite, finite).map(sorted).filter(lambda ends: ends[0] < ends[1])
).map(lambda some: {name: (low, high) for name, (low, high) in some.items()})


@given(ranges, st.integers(0, 2**53))
def test_numbers_are_short_in_their_range_and_the_same_for_a_seed(some: Any, seed: int) -> None:
    drawn = draw_numbers(some, seed)
    assert drawn == draw_numbers(some, seed)
    for name, value in drawn.items():
        low, high = some[name]
        assert low <= value <= high
        assert value in (low, high) or float(f"{value:.3g}") == value


def test_the_question_as_loaded_has_the_numbers_in_the_middle() -> None:
    question = parse_question(RAW)
    assert question.q == "With 1750 and $\\sqrt{1750}$ from -1.5 rad, and {other}?"
    assert question.verify is not None
    assert question.verify.setup == "data.qpos[0] = 1 - (-1.5)"  # type: ignore[union-attr]
    assert find_middle({"kp": (500, 3000)}) == {"kp": 1750}


def test_a_learners_question_has_their_numbers_and_key_alone() -> None:
    question = parse_question(RAW)
    assert isinstance(question, Drawable)
    own: Any = question.with_numbers({"kp": 500, "lean": -1}, {"": 7.5})
    assert (own.q, own.answer, own.draw) == ("With 500 and $\\sqrt{500}$ from -1 rad, and {other}?", 7.5, {})
    assert own.tolerance == pytest.approx(0.15)


def test_corners_are_all_low_all_high_and_each_alone() -> None:
    assert list(list_corners({"a": (0, 1), "b": (2, 3)})) == [
        {"a": 0, "b": 2}, {"a": 1, "b": 3}, {"a": 0, "b": 3}, {"a": 1, "b": 2},
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"draw": {"kp": [3000, 500]}}, "3000 is not below 500"),
        ({"draw": {"kp": [1, 2], "kv": [1, 2]}}, "q never shows {kv}"),
        ({"draw": {"kp": [1]}}, "draw"),
        ({"draw": {"kp": "1 to 2"}}, "draw"),
        ({"draw": {"k p": [1, 2]}}, "draw"),
        ({"draw": {f"a{i}": [1, 2] for i in range(9)}}, "draw"),
    ],
)
def test_a_draw_that_cannot_be_is_a_fault(change: dict[str, Any], why: str) -> None:
    with pytest.raises(ValidationError, match=why.replace("{", r"\{").replace("}", r"\}")):
        parse_question(RAW | change)


def test_a_name_in_braces_that_is_no_drawn_number_is_told() -> None:
    """Formulas and code have braces of their own."""
    assert [*list_unknown_names(parse_question(RAW))] == [("q", "other")]
    explain = "$\\frac{a}{b}$ <code>f'{x}'</code> {kp} {Kp}"
    question = parse_question(RAW | {"q": "{kp} {lean}", "explain": explain})
    assert [*list_unknown_names(question)] == [("explain", "Kp")]
    plain = {"id": "a", "kind": "numeric", "q": "{x}", "answer": 1}
    assert [*list_unknown_names(parse_question(plain))] == []
