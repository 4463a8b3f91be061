"""Nothing that a learner may not see yet is in a redacted verdict."""

import json
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grader.courses.rules.policy import NOT_ABOUT_CORRECTNESS, Decision, Visibility, decide, redact_json, report_verdict
from grader.domain.policy import Policy, Progress
from grader.domain.verdict import Finding, Status, Verdict, apply_review
from grader.grading.pipeline import Pipeline
from grader.library import load
from grader.questions import Reveal, grade_answer
from grader.questions.kinds.number import NumberQuestion
from grader.questions.kinds.text import TextQuestion

NOW = datetime(2026, 3, 10, tzinfo=UTC)
QUESTION = TextQuestion(kind="open", id="q1", q="Why?")
FEEDBACK = decide(Policy(), None, QUESTION, Progress(), NOW, role="student")
RECEIPT = decide(Policy(feedback="after_publish"), None, QUESTION, Progress(), NOW, role="student")
SOLUTION = decide(Policy(solutions="with_feedback"), None, QUESTION, Progress(), NOW, role="student")
JUDGED = [status for status in Status if status not in NOT_ABOUT_CORRECTNESS]


def revealing(reveal: Reveal) -> NumberQuestion:
    """A question whose author allows so much."""
    return NumberQuestion(kind="numeric", id="q2", q="How long?", answer=5.0, reveal=reveal)


DIRECTION, VALUE = (replace(FEEDBACK, question=revealing(reveal)) for reveal in ("direction", "value"))

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
    direction=st.none() | secrets,
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
        "direction": draw(st.none() | secrets),
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


def redact(verdict: Verdict, decision: Decision) -> Verdict:
    """What may be seen of a verdict, new and stored alike."""
    stored = json.loads(verdict.model_dump_json(exclude_defaults=True))
    shown = Verdict.model_validate(redact_json(verdict, decision))
    assert Verdict.model_validate(redact_json(stored, decision)) == shown
    return shown


def seen(verdict: Verdict, decision: Decision) -> str:
    return redact(verdict, decision).model_dump_json()


@given(answers(), outcomes(), outcomes())
def test_before_the_feedback_right_and_wrong_look_the_same(
    answer: dict[str, Any], one: dict[str, Any], other: dict[str, Any]
) -> None:
    first, second = seen(Verdict(**answer, **one), RECEIPT), seen(Verdict(**answer, **other), RECEIPT)
    assert first == second
    assert SECRET not in first
    assert json.loads(first).items() >= answer.items()  # what is the learner's own is not held back


@given(answers(), outcomes(), st.floats(0, 1), secrets)
def test_before_the_feedback_a_review_does_not_show(
    answer: dict[str, Any], outcome: dict[str, Any], share: float, comment: str
) -> None:
    verdict = Verdict(**answer, **outcome)
    assert seen(apply_review(verdict, share * verdict.max_points, comment), RECEIPT) == seen(verdict, RECEIPT)


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


def directed(finding: Finding, points: float) -> Finding:
    """A failed finding of which only the direction is the same for every key."""
    same = {"id": "a", "title": "A", "passed": False, "points": points, "max_points": 1.0, "direction": "Too high."}
    return finding.model_copy(update=same)


@given(answers(), outcomes(), outcomes(), st.lists(st.tuples(findings, findings), max_size=3))
def test_where_only_the_direction_is_told_verdicts_of_one_direction_look_the_same(
    answer: dict[str, Any], one: dict[str, Any], other: dict[str, Any], pairs: list[tuple[Finding, Finding]]
) -> None:
    told = {"status": Status.INCORRECT, "points": 0.0, "direction": "Too high.", "timing_ms": {}}
    own = {name: value for name, value in one["evidence"].items() if name in ("option", "angles")}
    sides = []
    for outcome, column in ((one, 0), (other, 1)):
        hidden = {name: value for name, value in outcome["evidence"].items() if name not in ("option", "angles")}
        told_findings = tuple(directed(pair[column], 0.0) for pair in pairs)
        verdict = Verdict(**answer, **outcome | told | {"findings": told_findings, "evidence": own | hidden})
        sides.append(seen(verdict, DIRECTION))
    assert sides[0] == sides[1]


def test_what_was_stored_before_directions_were_tells_nothing_of_size() -> None:
    finding = Finding(id="a", title="A", passed=False, points=0, max_points=1, message="off by 3.7 N", measured=1)
    verdict = Verdict(status=Status.INCORRECT, points=0, max_points=1, findings=(finding,), diagnosis="twice 3.7 N")
    assert "3.7" not in seen(verdict, DIRECTION)
    assert "3.7" in seen(verdict, FEEDBACK)


def test_a_reviewers_finding_is_told_as_it_was_written() -> None:
    verdict = Verdict(status=Status.NEEDS_REVIEW, points=0, max_points=1)
    shown = redact(apply_review(verdict, 0.5, "Look at the sign."), DIRECTION)
    assert [finding.message for finding in shown.findings] == ["Look at the sign."]


@given(answers(), outcomes())
def test_with_the_value_the_expected_values_are_shown_and_the_explanation_is_not(
    answer: dict[str, Any], outcome: dict[str, Any]
) -> None:
    shown = redact(Verdict(**answer, **outcome), VALUE)
    assert [finding.expected for finding in shown.findings] == [one.expected for one in outcome["findings"]]
    assert shown.explain is None


KEYS = st.floats(1, 1e3).map(lambda key: float(f"{key:.6g}"))
FACTORS = st.sampled_from([1.05, 1.5, 2, 5, 57.29578, 1000]) | st.floats(1.05, 1e6)


@given(KEYS, st.tuples(FACTORS, FACTORS), st.booleans(), st.sampled_from([None, "ms", "rad"]))
def test_a_wrong_number_tells_its_direction_alone(
    given_number: float, factors: tuple[float, float], below: bool, unit: str | None
) -> None:
    """Whatever the key is, the same wrong number on the same side of it gets the same feedback."""
    sides = []
    for factor in factors:
        key = given_number * factor if below else given_number / factor
        question = NumberQuestion(kind="numeric", id="q", q="?", answer=key, tol=key * 1e-3, unit=unit, explain="KEY")
        sides.append(seen(grade_answer(question, given_number), DIRECTION))
    assert sides[0] == sides[1]
    assert f"too {'low' if below else 'high'}." in sides[0]


def test_the_size_of_an_error_is_told_in_coarse_words() -> None:
    question = NumberQuestion(kind="numeric", id="q", q="?", answer=73.313, tol=0.1)
    said = [grade_answer(question, number).findings[0].message for number in (75, 120, 20, 1, -5)]
    assert [one.partition(", ")[2] for one in said] == [
        "by less than 10 %.",
        "by less than a factor of two.",
        "by a factor of two to ten.",
        "by more than a factor of ten.",
        "",
    ]


def test_a_command_reports_as_far_as_the_author_reveals() -> None:
    question = NumberQuestion(kind="numeric", id="q", q="?", answer=73.313, tol=0.1, explain="KEY")
    for reveal, held in ((None, ()), ("direction", ("KEY", "factor")), ("size", ("KEY",)), ("value", ("KEY",))):
        asked = question.model_copy(update={"reveal": reveal})
        told = report_verdict(grade_answer(asked, 146.626), asked).model_dump_json()
        assert ("73.313" in told) == (reveal == "value")
        assert not any(word in told for word in held)
        assert report_verdict(grade_answer(asked, 73.313), asked).explain == "KEY"


def test_a_command_reports_no_evidence_that_draws_the_solution() -> None:
    question = NumberQuestion(kind="numeric", id="q", q="?", answer=73.313, tol=0.1)
    film = {"title": "Your run", "rows": [[1.0]]}  # of the learner's own answer
    evidence = {"option": 1, "film": film, "regions": [73.313]}
    wrong, right = (grade_answer(question, one).model_copy(update={"evidence": evidence}) for one in (1, 73.313))
    assert report_verdict(wrong, question).evidence == {"option": 1, "film": film}
    assert report_verdict(right, question).evidence == evidence


@given(answers(), outcomes())
def test_with_the_solution_everything_is_shown(answer: dict[str, Any], outcome: dict[str, Any]) -> None:
    verdict = Verdict(**answer, **outcome)
    assert redact(verdict, SOLUTION) == verdict


@given(answers(), outcomes(), st.sampled_from(list(Visibility)), st.sampled_from(["direction", "size", "value"]))
def test_redacting_twice_changes_nothing(
    answer: dict[str, Any], outcome: dict[str, Any], shown: Visibility, reveal: Reveal
) -> None:
    decision = replace(RECEIPT, shown=shown, question=revealing(reveal))
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
