"""The part of a quiz that a learner may see: an allow-list, so that new fields are hidden by default."""

from typing import Any

from pydantic import BaseModel

from grader.domain.lab import IntegratorsLab, Lab, LabConfig, UnknownLab
from grader.domain.policy import Policy
from grader.questions.question import Question
from grader.questions.quiz import Quiz
from grader.questions.registry import kind_of

COMMON = ("id", "kind", "label", "title", "q", "points", "attempts")
LAB = ("id", "kind", "title", "note", "camera", "height", "autoplay", "overlays", "toggles", "forceScale")
INTEGRATORS_LAB = ("id", "kind", "title", "model", "models", "timestep", "seconds", "note")
UNKNOWN_LAB = ("id", "kind", "title")
CONTROL = ("type", "label", "unit", "min", "max", "step", "value", "digits", "options", "reset")
READOUT = ("label", "digits", "unit")
TRACE = ("label", "dash", "color")
PLOT = ("xlabel", "ylabel", "height", "window", "ymin", "ymax")


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


def lab_view(lab: Lab | LabConfig) -> dict[str, Any]:
    """The controls of a lab and the labels of its readouts and traces, without expressions or MJCF."""
    if isinstance(lab, IntegratorsLab):
        return _pick(lab, INTEGRATORS_LAB)
    if isinstance(lab, UnknownLab):
        return _pick(lab, UNKNOWN_LAB)
    return _pick(lab, LAB) | {
        "controls": [_pick(control, CONTROL) for control in lab.controls],
        "readouts": [_pick(readout, READOUT) for readout in lab.readouts],
        "plots": [_pick(plot, PLOT) | {"traces": [_pick(trace, TRACE) for trace in plot.traces]} for plot in lab.plots],
    }


def _pick(part: BaseModel, names: tuple[str, ...]) -> dict[str, Any]:
    """The fields of the part with these names, as plain JSON."""
    return part.model_dump(mode="json", include=set(names))
