"""Wrong choices of a class are mistakes with the name of what was chosen."""

from datetime import UTC, datetime
from pathlib import Path

import pytest

from grader.courses.reporting.class_answers import ClassAnswers, ClassAttempt, name_choices
from grader.courses.rules.mistakes import Mistake, name_mistake
from grader.questions import Question
from support.content import load_content

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def question() -> Question:
    """Returns a question with options, of which the second is right."""
    return load_content().question("1.3-check", "q1")


def attempt(learner: str, mistake: Mistake | None, *options: int) -> ClassAttempt:
    """Returns an attempt that chose these options."""
    at = datetime(2026, 11, 1, tzinfo=UTC)
    return ClassAttempt(learner, learner, learner, 1, at, mistake is None, mistake, None, {}, options)


def test_a_wrong_choice_is_named_by_its_option(question: Question) -> None:
    wrong = name_mistake("incorrect", None)
    attempts = [attempt("a", wrong, 0), attempt("b", wrong, 0), attempt("c", wrong, 2), attempt("d", None, 1)]
    answers = name_choices(ClassAnswers((), {one.learner: [one] for one in attempts}), question)
    assert [(family.name, family.learners) for family in answers.families] == [
        ("Chose: Velocity stage", 2),
        ("Chose: Constraint stage", 1),
    ]


def test_a_diagnosis_and_an_unknown_option_stay_as_they_are(question: Question) -> None:
    told, other = name_mistake("incorrect", "You took the bound."), name_mistake("incorrect", None)
    attempts = [attempt("a", told, 0), attempt("b", other, 9), attempt("c", other)]
    answers = name_choices(ClassAnswers((), {one.learner: [one] for one in attempts}), question)
    assert {family.name for family in answers.families} == {"You took the bound", "Another mistake"}
