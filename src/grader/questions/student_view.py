"""The part of a quiz that a learner may see: an allow-list, so that new fields are hidden by default."""

from typing import Any

from pydantic import BaseModel

from grader.domain.lab import Lab, LabConfig, UnknownLab
from grader.domain.policy import Policy
from grader.labs import lab_kind_of
from grader.questions.question import Question
from grader.questions.quiz import Quiz
from grader.questions.registry import kind_of

COMMON = ("id", "kind", "label", "title", "q", "points", "attempts")
LAB = ("id", "kind", "title", "note")
UNKNOWN_LAB = ("id", "kind", "title")


def student_view(quiz: Quiz, policy: Policy) -> dict[str, Any]:
    """The quiz as plain JSON with the policy in force, without answers, tolerances, explanations, references, checks or
    expressions."""
    return {
        "id": quiz.id,
        "title": quiz.title,
        "policy": policy.model_dump(mode="json"),
        "questions": [question_view(question) for question in quiz.questions],
        "labs": [lab_view(lab) for lab in quiz.labs],
    }


def unopened_view(quiz: Quiz, policy: Policy) -> dict[str, Any]:
    """The quiz before it opens: the policy in force, without questions and labs."""
    rules = policy.model_dump(mode="json")
    return {"id": quiz.id, "title": quiz.title, "policy": rules, "questions": [], "labs": []}


def question_view(question: Question) -> dict[str, Any]:
    """One question: what every question shows, and what its kind does."""
    return _pick(question, COMMON) | kind_of(question).view(question)


def lab_view(lab: Lab | LabConfig | UnknownLab) -> dict[str, Any]:
    """One lab: what every lab shows, and what its kind does."""
    if isinstance(lab, UnknownLab):
        return _pick(lab, UNKNOWN_LAB)
    return _pick(lab, LAB) | lab_kind_of(lab).view(lab)


def _pick(part: BaseModel, names: tuple[str, ...]) -> dict[str, Any]:
    """The fields of the part with these names, as plain JSON."""
    return part.model_dump(mode="json", include=set(names))
