"""Pairs of texts: points by pairs, a shift by one line, and a shown order that tells nothing."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from grader.domain.verdict import Status
from grader.errors import InvalidAnswer
from grader.questions import grade_answer, parse_question, question_view
from grader.questions.kinds.match import Match, MatchQuestion

KIND = Match()
PAIRS = [["damping", "N m s/rad"], ["armature", "kg m2"], ["stiffness", "N m/rad"], ["gain", "N m/rad"]]


def asked(pairs: list[list[str]], **more: Any) -> MatchQuestion:
    question = parse_question({"id": "m", "kind": "match", "q": "Which?", "pairs": pairs, **more})
    assert isinstance(question, MatchQuestion)
    return question


def answered(question: MatchQuestion, rights: list[str]) -> dict[str, str]:
    """The answer with these right texts, in the order of the left ones."""
    ids = {right["text"]: right["id"] for right in question_view(question)["right"]}
    return {left["id"]: ids[text] for left, text in zip(question_view(question)["left"], rights, strict=True)}


@st.composite
def questions_and_answers(draw: st.DrawFn) -> tuple[MatchQuestion, list[str]]:
    """A question, and right texts in the order of the left ones."""
    rights = draw(st.lists(st.integers(0, 9).map(lambda n: f"right {n}"), min_size=2, max_size=7))
    extra = draw(st.lists(st.integers(10, 14).map(lambda n: f"right {n}"), min_size=1, max_size=3, unique=True))
    pairs = [[f"left {n}", right] for n, right in enumerate(rights)]
    chosen = draw(st.lists(st.sampled_from([*rights, *extra]), min_size=len(pairs), max_size=len(pairs)))
    return asked(pairs, extra=extra, points=draw(st.floats(0.1, 1000))), draw(st.sampled_from([rights, chosen]))


@given(questions_and_answers())
def test_points_are_the_share_of_right_pairs(case: tuple[MatchQuestion, list[str]]) -> None:
    question, rights = case
    verdict = grade_answer(question, answered(question, rights))
    right = [one == text for one, (_, text) in zip(rights, question.pairs, strict=True)]
    assert verdict.points == pytest.approx(question.points * sum(right) / len(right), abs=1e-8)
    assert [finding.passed for finding in verdict.findings] == right
    assert verdict.max_points == pytest.approx(question.points, abs=1e-8)
    assert (verdict.status is Status.CORRECT) == all(right)


@given(questions_and_answers())
def test_a_form_reads_back_as_the_same_pairs(case: tuple[MatchQuestion, list[str]]) -> None:
    question, rights = case
    answer = answered(question, rights)
    assert KIND.from_form(question, KIND.to_form(question, answer)) == answer


@given(questions_and_answers())
def test_the_options_that_are_counted_are_the_pairs(case: tuple[MatchQuestion, list[str]]) -> None:
    question, rights = case
    options = KIND.options(question)
    counted = [options[index] for index in grade_answer(question, answered(question, rights)).evidence["option"]]
    pairs = list(zip([left for left, _ in question.pairs], rights, strict=True))
    assert [option.text for option in counted] == [f"{left}: {right}" for left, right in pairs]
    assert [option.is_right for option in counted] == [pair in question.pairs for pair in pairs]


@given(st.permutations(["N m", "rad/s", "kg", "m/s", "J"]), st.integers(2, 4))
def test_what_is_shown_on_the_right_depends_on_the_set_of_texts_alone(rights: list[str], count: int) -> None:
    pairs = [[f"left {n}", right] for n, right in enumerate(rights[:count])]
    shown = question_view(asked(pairs, extra=rights[count:]))
    assert shown["right"] == question_view(asked([["l", "J"], ["m", "kg"]], extra=["N m", "m/s", "rad/s"]))["right"]
    assert [left["text"] for left in shown["left"]] == [left for left, _ in pairs]
    assert [right["id"] for right in shown["right"]] == [*"abcde"]


def test_a_text_that_serves_two_is_one_option() -> None:
    question = asked(PAIRS)
    assert len(question_view(question)["right"]) == 3
    assert grade_answer(question, answered(question, [right for _, right in PAIRS])).status is Status.CORRECT


@pytest.mark.parametrize(("by", "where"), [(1, "below"), (-1, "above")])
def test_a_shift_by_one_line_is_named(by: int, where: str) -> None:
    rights = [f"right {n}" for n in range(4)]
    question = asked([[f"left {n}", right] for n, right in enumerate(rights)])
    shifted = [rights[(n + by) % 4] for n in range(4)]
    assert f"the line {where}" in (grade_answer(question, answered(question, shifted)).diagnosis or "")
    assert grade_answer(question, answered(question, [rights[1], rights[0], rights[3], rights[2]])).diagnosis is None
    assert grade_answer(question, answered(question, rights)).diagnosis is None


def test_only_expected_tells_the_right_partner() -> None:
    question = asked([["damping", "N m s/rad"], ["armature", "kg m2"]])
    first, _ = grade_answer(question, answered(question, ["kg m2", "kg m2"])).findings
    assert (first.message, first.expected) == ('"damping" does not go with "kg m2".', "N m s/rad")
    assert first.direction == first.message


@pytest.mark.parametrize(("answer", "why"), [
    ({}, '"damping" has no partner'), ({"1": "a", "2": "a", "3": "a"}, '"gain" has no partner'),
    ({"1": "z"}, "has a partner that is none of the letters: choose one of a, b, c"), ({"1": 0}, "none of the letters"),
    ({"1": ["a"]}, "none of the letters"),
    ({"5": "a"}, "such as"), (["a"], "such as"), ("a", "such as"), (None, "such as"), (True, "such as"),
])  # fmt: skip
def test_what_cannot_be_read_says_why(answer: Any, why: str) -> None:
    with pytest.raises(InvalidAnswer, match=why):
        KIND.read(asked(PAIRS), answer)


@pytest.mark.parametrize(("pairs", "extra"), [
    (PAIRS[:1], []), ([["a", "x"], ["a", "y"]], []), ([["a", "x"], ["b", "x"]], []), ([["a", "x"], ["b", "y"]], ["x"]),
    ([["a", "x"], ["b", "y"]], ["z", "z"]), ([["a", "x"], ["b"]], []), ([["a", "x"], ["b", ""]], []),
])  # fmt: skip
def test_pairs_that_make_no_sense_are_refused(pairs: list[list[str]], extra: list[str]) -> None:
    with pytest.raises(ValidationError):
        asked(pairs, extra=extra)
