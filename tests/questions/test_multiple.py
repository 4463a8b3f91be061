"""Several right options: points, what is told, and what cannot be read."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from grader.courses.rules.policy import limit_feedback
from grader.domain.verdict import Status
from grader.errors import InvalidAnswer
from grader.questions import grade_answer, kind_of, parse_question
from grader.questions.kinds.multiple import Multiple, MultipleQuestion

KIND = Multiple()


def asked(**more: Any) -> MultipleQuestion:
    raw = {"id": "m", "kind": "multiple", "q": "Which?", "options": ["a", "b", "c", "d"], "answer": [0, 2], **more}
    question = parse_question(raw)
    assert isinstance(question, MultipleQuestion)
    return question


@st.composite
def questions_and_answers(draw: st.DrawFn) -> tuple[MultipleQuestion, list[int]]:
    count = draw(st.integers(2, 9))
    indices = st.integers(0, count - 1)
    key = draw(st.lists(indices, min_size=1, unique=True))
    question = asked(options=[f"option {i}" for i in range(count)], answer=key, points=draw(st.floats(0.1, 1000)))
    return question, draw(st.lists(indices, unique=True))


@given(questions_and_answers())
def test_points_are_right_ones_less_wrong_ones_and_never_below_0(case: tuple[MultipleQuestion, list[int]]) -> None:
    question, answer = case
    verdict = grade_answer(question, answer)
    right, wrong = len({*answer} & {*question.answer}), len({*answer} - {*question.answer})
    assert verdict.points == pytest.approx(question.points * max(0, right - wrong) / len(question.answer), abs=1e-8)
    assert verdict.max_points == pytest.approx(question.points, abs=1e-8)
    assert (verdict.status is Status.CORRECT) == ({*answer} == {*question.answer})
    assert sum(finding.points for finding in verdict.findings) == pytest.approx(verdict.points, abs=1e-8)
    assert verdict.evidence == {"option": sorted(answer)}


@given(questions_and_answers())
def test_the_order_of_the_choices_does_not_matter(case: tuple[MultipleQuestion, list[int]]) -> None:
    question, answer = case
    assert grade_answer(question, answer) == grade_answer(question, answer[::-1])


@given(questions_and_answers())
def test_a_form_reads_back_as_the_same_choice(case: tuple[MultipleQuestion, list[int]]) -> None:
    question, answer = case
    fields = KIND.to_form(question, answer)
    if answer:
        assert KIND.from_form(question, fields) == sorted(answer)
    else:
        with pytest.raises(InvalidAnswer, match="Choose at least one"):
            KIND.from_form(question, fields)


def test_choosing_nothing_is_an_answer_of_the_api() -> None:
    verdict = grade_answer(asked(), [])
    assert (verdict.status, verdict.points, verdict.read_as) == (Status.INCORRECT, 0, "nothing")


@pytest.mark.parametrize(("answer", "why"), [
    ([0, 0], "twice"), (["0", 0], "twice"), ([0, 1, 2, 3, 0], "twice"), ([4], "from 0 to 3"), ([-1], "from 0 to 3"),
    ([True], "not an option"), ([[0]], "not an option"), ([0.5], "not an option"), (0, "a list"), ("0", "a list"),
    ({"0": 1}, "a list"), (None, "a list"),
])  # fmt: skip
def test_what_cannot_be_read_says_why(answer: Any, why: str) -> None:
    with pytest.raises(InvalidAnswer, match=why):
        KIND.read(asked(), answer)


def test_a_text_of_an_option_and_digits_are_read() -> None:
    assert KIND.read(asked(), ["C", "0"]) == (0, 2)
    assert KIND.from_text(asked(), "[0, 2]") == [0, 2]
    assert grade_answer(asked(), KIND.from_text(asked(), "[0, 2")).status is Status.INVALID_ANSWER


def test_a_wrong_answer_is_told_of_its_own_options_and_that_some_are_missing() -> None:
    question = asked(options=["Euler", "RK4", "implicit", "discrete"], whys=["W0.", "W1.", "SECRET.", "W3."])
    verdict = grade_answer(question, [0, 1])
    assert [finding.passed for finding in verdict.findings] == [True, False, False]
    assert [finding.message for finding in verdict.findings] == [
        '"Euler" is right. W0.', '"RK4" is not right. W1.', "At least one right option is not chosen.",
    ]  # fmt: skip
    hidden = limit_feedback(verdict, "size").model_dump_json()
    assert "implicit" not in hidden
    assert "SECRET" not in hidden
    assert verdict.findings[-1].expected == "implicit"


def test_ticking_everything_is_diagnosed_only_where_something_is_wrong() -> None:
    assert "every option" in (grade_answer(asked(), [0, 1, 2, 3]).diagnosis or "")
    assert grade_answer(asked(answer=[0, 1, 2, 3]), [0, 1, 2, 3]).diagnosis is None


@pytest.mark.parametrize("wrong", [{"answer": []}, {"answer": [0, 0]}, {"answer": [4]}, {"answer": [True]},
                                   {"answer": 0}, {"options": ["a"]}, {"whys": ["one"]}])  # fmt: skip
def test_a_key_that_makes_no_sense_is_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        asked(**wrong)


def test_every_option_is_counted() -> None:
    assert [option.is_right for option in KIND.options(asked())] == [True, False, True, False]
    assert kind_of(asked()).show(asked(), [2, 0]) == "a; c"
    assert kind_of(asked()).show(asked(), [7]) == "[7]"


def test_points_for_choosing_every_option_are_remarked_on() -> None:
    def told(**more: Any) -> list[str]:
        return [remark.why for remark in KIND.warnings(asked(**more)) if "every option" in remark.why]

    [why] = told(answer=[0, 1, 2], points=3)
    assert why.startswith("choosing every option earns 2 points")
    assert not told()
    assert not told(answer=[0, 1, 2, 3])
