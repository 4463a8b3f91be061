"""Nothing that a learner may not see yet is in a redacted verdict."""

import json
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grader.courses.policy import NOT_ABOUT_CORRECTNESS, Decision, Shown, decide, redact
from grader.domain.policy import Policy, Progress
from grader.domain.quiz import OpenQuestion
from grader.domain.verdict import Finding, Status, Verdict, reviewed
from grader.library import load
from grader.pipeline import Pipeline
from properties import patient

NOW = datetime(2026, 3, 10, tzinfo=UTC)
QUESTION = OpenQuestion(kind="open", id="q1", q="Why?")
FEEDBACK = decide(Policy(), None, QUESTION, Progress(), NOW, role="student")
RECEIPT = decide(Policy(feedback="after_publish"), None, QUESTION, Progress(), NOW, role="student")
SOLUTION = decide(Policy(solutions="with_feedback"), None, QUESTION, Progress(), NOW, role="student")
JUDGED = [status for status in Status if status not in NOT_ABOUT_CORRECTNESS]

SECRET = "SECRET-"
words = st.text("abc", min_size=1, max_size=5)
secrets = words.map(lambda word: SECRET + word)
values: st.SearchStrategy[Any] = secrets | st.lists(secrets, max_size=2) | st.dictionaries(words, secrets, max_size=2)
findings = st.builds(
    Finding,
    id=secrets,
    title=secrets,
    passed=st.none() | st.booleans(),
    points=st.floats(0, 1),
    max_points=st.floats(0, 1),
    message=secrets,
    measured=values,
    expected=values,
)


@st.composite
def outcomes(draw: st.DrawFn) -> dict[str, Any]:
    """What grading adds to an answer, all of it about correctness."""
    return {
        "status": draw(st.sampled_from(JUDGED)),
        "points": draw(st.floats(0, 1)),
        "findings": tuple(draw(st.lists(findings, max_size=3))),
        "diagnosis": draw(st.none() | secrets),
        "explain": draw(st.none() | secrets),
        "evidence": draw(st.dictionaries(st.sampled_from(["option", "angles", "stability", "order"]), values)),
        "timing_ms": {"script_cpu": 2.0, **draw(st.dictionaries(secrets, st.floats(0, 9), max_size=2))},
    }


@st.composite
def answers(draw: st.DrawFn) -> dict[str, Any]:
    """What an answer brings whatever it is worth."""
    text = st.text(max_size=5)
    return {
        "max_points": draw(st.floats(0.1, 9)),
        "read_as": draw(st.none() | text),
        "stdout": draw(text),
        "stderr": draw(text),
        "environment": {"mujoco": "3.14.0"},
        "content_digest": draw(text),
        "submission_digest": draw(text),
    }


def seen(verdict: Verdict, decision: Decision) -> str:
    return redact(verdict, decision).model_dump_json()


@patient
@given(answers(), outcomes(), outcomes())
def test_before_the_feedback_right_and_wrong_look_the_same(
    answer: dict[str, Any], one: dict[str, Any], other: dict[str, Any]
) -> None:
    first, second = seen(Verdict(**answer, **one), RECEIPT), seen(Verdict(**answer, **other), RECEIPT)
    assert first == second
    assert SECRET not in first
    assert json.loads(first).items() >= answer.items()  # what is the learner's own is not held back


@patient
@given(answers(), outcomes(), st.floats(0, 1), secrets)
def test_before_the_feedback_a_review_does_not_show(
    answer: dict[str, Any], outcome: dict[str, Any], share: float, comment: str
) -> None:
    verdict = Verdict(**answer, **outcome)
    assert seen(reviewed(verdict, share * verdict.max_points, comment), RECEIPT) == seen(verdict, RECEIPT)


@patient
@given(answers(), outcomes())
def test_before_the_solution_neither_explanation_nor_expected_value_is_shown(
    answer: dict[str, Any], outcome: dict[str, Any]
) -> None:
    verdict = Verdict(**answer, **outcome)
    shown = redact(verdict, FEEDBACK)
    assert shown.explain is None
    assert "stability" not in shown.evidence
    assert [finding.expected for finding in shown.findings] == [None] * len(verdict.findings)
    told = ("status", "points", "diagnosis", "timing_ms", *answer)
    assert {name: getattr(shown, name) for name in told} == {name: getattr(verdict, name) for name in told}
    assert [f.model_copy(update={"expected": None}) for f in verdict.findings] == list(shown.findings)


@patient
@given(answers(), outcomes())
def test_with_the_solution_everything_is_shown(answer: dict[str, Any], outcome: dict[str, Any]) -> None:
    verdict = Verdict(**answer, **outcome)
    assert redact(verdict, SOLUTION) == verdict


@patient
@given(answers(), outcomes(), st.sampled_from(list(Shown)))
def test_redacting_twice_changes_nothing(answer: dict[str, Any], outcome: dict[str, Any], shown: Shown) -> None:
    decision = replace(RECEIPT, shown=shown)
    once = redact(Verdict(**answer, **outcome), decision)
    assert redact(once, decision) == once


@pytest.mark.parametrize("status", NOT_ABOUT_CORRECTNESS)
def test_what_went_wrong_before_judging_is_told_at_once(status: Status) -> None:
    verdict = Verdict(status=status, points=0.0, max_points=1.0, diagnosis="The script is empty.", stdout="hello")
    shown = redact(verdict, RECEIPT)
    assert shown == verdict


QUIZ = {
    "id": "quiz",
    "title": "A quiz",
    "questions": [
        {"kind": "numeric", "q": "How long?", "answer": 73.313, "tol": 0.0421, "unit": "ms", "explain": "KEY"},
        {"kind": "mcq", "q": "Which?", "options": ["one", "two"], "answer": 1, "explain": "two"},
    ],
}


@pytest.fixture(scope="module")
def pipeline(tmp_path_factory: pytest.TempPathFactory) -> Pipeline:
    root: Path = tmp_path_factory.mktemp("content")
    (root / "quizzes").mkdir()
    (root / "quizzes" / "quiz.json").write_text(json.dumps(QUIZ))
    return Pipeline(load(root))


def test_the_learner_is_told_when_the_feedback_comes(pipeline: Pipeline) -> None:
    shown = redact(pipeline.grade("quiz", "q1", "73.313"), RECEIPT)
    assert shown.status is Status.NEEDS_REVIEW
    assert shown.diagnosis == RECEIPT.withheld
    assert shown.read_as == "73.313 ms"


@pytest.mark.parametrize("decision", [RECEIPT, FEEDBACK], ids=lambda decision: decision.shown.name)
def test_the_key_is_in_no_real_verdict_on_a_wrong_number(pipeline: Pipeline, decision: Decision) -> None:
    for answer in ("80 ms", "0.07 s", "-73.3 ms", "146.6 ms", "nonsense"):
        shown = seen(pipeline.grade("quiz", "q1", answer), decision)
        assert "73.313" not in shown
        assert "KEY" not in shown


def test_the_right_option_is_not_in_the_verdict_on_another(pipeline: Pipeline) -> None:
    verdict = pipeline.grade("quiz", "q2", 0)
    assert "two" not in seen(verdict, FEEDBACK)
    assert "two" in seen(verdict, SOLUTION)
