"""Policies and rubrics in quiz files: read, and their faults told with key and cure."""

import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest

from grader.domain.policy import Policy
from grader.errors import ContentError
from grader.library import load
from grader.questions import student_view

RUBRIC = [{"id": "idea", "title": "SECRET", "points": 1}]
OPEN: dict[str, Any] = {"kind": "open", "q": "Why?"}
OFFSET = "must be a date and time with its offset, such as 2026-10-19T18:00+02:00, not "
POLICY: dict[str, Any] = {"due": "2026-03-10T18:00+01:00", "attempts": 3, "feedback": "after_due"}


def write(root: Path, quiz: dict[str, Any]) -> Path:
    (root / "quizzes").mkdir()
    (root / "quizzes" / "quiz.json").write_text(json.dumps({"id": "quiz", "title": "A quiz", **quiz}))
    return root


def test_a_policy_and_a_rubric_are_read(tmp_path: Path) -> None:
    quiz = load(write(tmp_path, {"policy": POLICY, "questions": [{**OPEN, "rubric": RUBRIC}]})).quiz("quiz")
    assert quiz.default_policy.due == datetime(2026, 3, 10, 17, tzinfo=UTC)
    assert quiz.default_policy.counts == "best"
    assert "SECRET" not in json.dumps(student_view(quiz, quiz.default_policy))


def test_a_quiz_without_a_policy_has_the_default(tmp_path: Path) -> None:
    assert load(write(tmp_path, {"questions": [OPEN]})).quiz("quiz").default_policy == Policy()


@pytest.mark.parametrize(
    ("quiz", "key", "why"),
    [
        ({"policy": {"atempts": 2}}, "policy.atempts", "unknown key: write 'attempts', or remove it, or begin it"),
        ({"policy": {"due": "tomorrow"}}, "policy.due", OFFSET + "'tomorrow'"),
        ({"policy": {"due": "2026-03-10T18:00"}}, "policy.due", OFFSET + "'2026-03-10T18:00'"),
        ({"policy": {"due": 1}}, "policy.due", OFFSET + "1"),
        ({"policy": {**POLICY, "late": {"per_day": 0.8}}}, "policy.late.until", "is missing: add it"),
        ({"policy": {**POLICY, "opens": "2026-03-11T18:00+01:00"}}, "policy.due", "must be later than opens"),
        ({"policy": {"feedback": "after_due"}}, "policy.feedback", "after_due needs a due date: add due"),
        ({"policy": {"counts": "worst"}}, "policy.counts", "must be 'best', 'latest' or 'average', not 'worst'"),
        ({"questions": [{**OPEN, "rubric": [{"id": "a"}]}]}, "q1.rubric.0.points", "is missing: add it"),
        ({"questions": [{**OPEN, "points": 2, "rubric": RUBRIC}]}, "q1.rubric", "the items add up to 1 of 2 points"),
        (
            {"questions": [{**OPEN, "rubric": [{**RUBRIC[0], "titel": "x"}]}]},
            "q1.rubric.0.titel",
            "unknown key: write 'title'",
        ),
    ],
)
def test_a_fault_is_told_at_its_key(tmp_path: Path, quiz: dict[str, Any], key: str, why: str) -> None:
    with pytest.raises(ContentError) as error:
        load(write(tmp_path, quiz))
    told = {fault.key: fault.why for fault in error.value.faults}
    assert key in told
    assert why in told[key]
