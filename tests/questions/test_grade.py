"""Choices and texts, and what every typed answer has in common."""

import json
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from grader.domain.verdict import Status, Verdict
from grader.errors import InvalidAnswer
from grader.questions import Question, grade_answer, kind_of, read_answer
from grader.questions.kinds.choice import ChoiceQuestion
from grader.questions.kinds.number import NumberQuestion
from grader.questions.kinds.predict import PredictQuestion
from grader.questions.kinds.text import CHARACTERS_MAX, TextQuestion

OPTIONS = ("Velocity &amp; force stage", "<code>Position</code> stage", "$h < 2I/c$ and x > 3", "Integration")
CHOICE = ChoiceQuestion(id="q1", kind="mcq", q="Which?", options=OPTIONS, answer=1, explain="<p>Why.</p>", points=3)
PREDICT = PredictQuestion(id="q3", kind="predict", q="Which?", options=OPTIONS, answer=2)
NUMERIC = NumberQuestion(id="q2", kind="numeric", q="How long?", answer=5, tol=0.05, unit="ms", explain="<p>5 ms</p>")
OPEN = TextQuestion(id="q4", kind="open", q="Why?", reference="<p>Secret.</p>", points=4)

json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(st.characters(exclude_categories=())),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=5,
)


@pytest.mark.parametrize("answer", [1, 1.0, "1", " 1 ", "<code>position</code>  STAGE", "Position stage"])
def test_a_choice_by_index_or_text(answer: Any) -> None:
    verdict = grade_answer(CHOICE, answer)
    assert (verdict.status, verdict.points, verdict.max_points) == (Status.CORRECT, 3, 3)
    assert (verdict.read_as, verdict.explain) == ("Position stage", "<p>Why.</p>")
    assert verdict.evidence == {"option": 1}


@pytest.mark.parametrize(("index", "text"), [(0, "Velocity & force stage"), (2, "$h < 2I/c$ and x > 3")])
def test_an_option_is_read_as_the_words_that_are_seen(index: int, text: str) -> None:
    assert read_answer(CHOICE, index) == text
    assert read_answer(CHOICE, text) == text


def test_tex_is_not_taken_for_a_tag() -> None:
    question = ChoiceQuestion(id="q", kind="mcq", q="Which?", options=("$a<b$ and $c>d$", "<i>none</i>"), answer=0)
    assert [read_answer(question, index) for index in (0, 1)] == ["$a<b$ and $c>d$", "none"]


def test_a_wrong_choice_is_not_told_the_right_one() -> None:
    verdict = grade_answer(CHOICE, 0)
    assert (verdict.status, verdict.points) == (Status.INCORRECT, 0)
    assert [finding.expected for finding in verdict.findings] == [None]
    assert "Position" not in verdict.model_dump_json(exclude={"explain"})


def test_a_choice_is_told_why_where_the_author_says_so() -> None:
    question = CHOICE.model_copy(update={"whys": ("Forces come <i>later</i>.", "", "A bound of the integrator.", "")})
    told = [grade_answer(question, index).findings[0].message for index in range(3)]
    assert told == ["Forces come later.", "This option is right.", "A bound of the integrator."]
    assert grade_answer(CHOICE, 0).findings[0].message == "This option is not right."


def test_a_why_belongs_to_every_option_or_to_none() -> None:
    with pytest.raises(ValidationError, match="there are 1 sentences for 4 options"):
        ChoiceQuestion.model_validate({**CHOICE.model_dump(), "whys": ["Only one."]})


def test_predict_is_graded_as_a_choice() -> None:
    assert grade_answer(PREDICT, 2).status is Status.CORRECT
    assert grade_answer(PREDICT, 1).status is Status.INCORRECT


@pytest.mark.parametrize(
    "answer",
    [
        "\ud800",
        "<b>\ud800</b>",
        True,
        False,
        4,
        -1,
        "4",
        "-1",
        1.5,
        None,
        [1],
        {"option": 1},
        "",
        "Pos",
        "1e0",
        10**400,
    ],
)
def test_no_option(answer: Any) -> None:
    verdict = grade_answer(CHOICE, answer)
    assert verdict.status is Status.INVALID_ANSWER
    assert not verdict.status.uses_attempt
    assert verdict.diagnosis is not None and "from 0 to 3" in verdict.diagnosis
    assert (verdict.explain, verdict.read_as, verdict.findings) == (None, None, ())


def test_an_index_goes_before_an_option_that_reads_like_one() -> None:
    numbers = ChoiceQuestion(id="q", kind="mcq", q="How many?", options=("2", "1", "4"), answer=2)
    assert grade_answer(numbers, "2").read_as == "4"
    assert grade_answer(numbers, "4").status is Status.INVALID_ANSWER


def test_an_option_that_is_read_as_the_number_of_another_is_a_remark() -> None:
    for options, is_told in (
        (("2", "1", "4"), True), (("0", "1", "2"), False), (("2 m", "1 m"), False), (("<b>1</b>", "0.5"), True),
    ):  # fmt: skip
        question = ChoiceQuestion(
            id="q", kind="mcq", q="How many?", options=options, answer=1, whys=("",) * len(options)
        )
        remarks = list(kind_of(question).warnings(question))
        assert [remark.key for remark in remarks] == ["options"] * is_told


def test_two_options_of_the_same_words_are_told_apart_by_index_only() -> None:
    twins = ChoiceQuestion(id="q", kind="mcq", q="Which?", options=("<b>A</b>", "a", "B"), answer=1)
    assert grade_answer(twins, "a").status is Status.INVALID_ANSWER
    assert grade_answer(twins, 1).status is Status.CORRECT


def test_a_text_waits_for_a_person() -> None:
    verdict = grade_answer(OPEN, "  I would check stability first.  ")
    assert (verdict.status, verdict.points, verdict.max_points) == (Status.NEEDS_REVIEW, 0, 4)
    assert verdict.read_as == "a text of 5 words"
    assert [finding.passed for finding in verdict.findings] == [None]
    assert "Secret" not in verdict.model_dump_json()


@pytest.mark.parametrize(
    "answer", ["", " \n\t ", None, 5, True, ["text"], "a\0b", "a\ud800b", "x" * (CHARACTERS_MAX + 1)]
)
def test_no_text(answer: Any) -> None:
    assert grade_answer(OPEN, answer).status is Status.INVALID_ANSWER


def test_the_longest_text_is_taken() -> None:
    assert read_answer(OPEN, "x" * CHARACTERS_MAX) == "a text of 1 word"


@pytest.mark.parametrize("question", [CHOICE, NUMERIC, OPEN])
def test_reading_raises_what_grading_diagnoses(question: Question) -> None:
    with pytest.raises(InvalidAnswer) as error:
        read_answer(question, None)
    assert grade_answer(question, None).diagnosis == str(error.value)


@settings(max_examples=200)
@given(json_values, st.sampled_from([CHOICE, PREDICT, NUMERIC, OPEN]))
def test_any_json_value_gets_a_verdict_that_can_be_sent(answer: Any, question: Question) -> None:
    verdict = grade_answer(question, answer)
    assert verdict.status in (Status.CORRECT, Status.INCORRECT, Status.NEEDS_REVIEW, Status.INVALID_ANSWER)
    assert (verdict.diagnosis is None) or verdict.diagnosis.endswith(".")
    assert (verdict.read_as is None) == (verdict.status is Status.INVALID_ANSWER)
    assert Verdict.model_validate(json.loads(verdict.model_dump_json())) == verdict
