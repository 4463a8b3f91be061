"""A learner's view of a quiz holds nothing that the author keeps back."""

import json

from grader.questions import Quiz, kind_of, lab_view, student_view

SECRET = "SECRET"

QUIZ = Quiz.model_validate(
    {
        "id": "all-kinds",
        "title": "All kinds",
        "questions": [
            {"id": "q1", "kind": "mcq", "q": "One?", "options": ["a", "b"], "answer": 1, "explain": SECRET},
            {"id": "q2", "kind": "numeric", "q": "Two?", "answer": 73313, "tol": 0.0421, "unit": "ms"},
            {
                "id": "q3",
                "kind": "predict",
                "q": "Three?",
                "options": ["a", "b"],
                "answer": 0,
                "verify": {"by": "expression", "expr": SECRET},
                "sim": {
                    "model": "pendulum",
                    "setup": SECRET,
                    "note": SECRET,
                    "controls": [{"type": "button", "label": "push", "run": SECRET}],
                },
            },
            {"id": "q4", "kind": "open", "q": "Four?", "reference": SECRET},
            {
                "id": "q5",
                "kind": "code",
                "q": "Five?",
                "entry": "f",
                "starter": "starters/f.py",
                "check": {"kind": "threshold", "cases": [SECRET]},
            },
        ],
        "labs": [
            {
                "id": "lab1",
                "kind": "simlab",
                "model": "pendulum",
                "controller": SECRET,
                "controls": [
                    {"label": "kp", "set": SECRET, "min": 0, "max": 2, "step": 1, "value": 1},
                    {"type": "select", "label": "pick", "apply": SECRET, "options": [["x", 0]], "value": 0},
                ],
                "readouts": [{"label": "angle", "expr": SECRET, "digits": 3}],
                "plots": [{"ylabel": "q", "traces": [{"label": "q", "expr": SECRET}]}],
            },
            {"id": "lab2", "kind": "integrators", "model": "double_pendulum"},
        ],
    }
)


def test_nothing_kept_back_is_in_the_view() -> None:
    text = json.dumps(student_view(QUIZ, QUIZ.default_policy))
    for kept in (SECRET, "73313", "0.0421", "answer", "explain", "reference", "verify", "tol", "check", "expr"):
        assert kept not in text


def test_what_a_page_needs_is_in_the_view() -> None:
    view = student_view(QUIZ, QUIZ.default_policy)
    assert [q["id"] for q in view["questions"]] == ["q1", "q2", "q3", "q4", "q5"]
    assert view["questions"][1]["unit"] == "ms"
    assert view["questions"][4]["limits"]["memory_mb"] == 512
    assert view["questions"][4]["has_starter"] is True
    assert view["labs"][0]["controls"][0]["max"] == 2
    assert view["labs"][0]["readouts"] == [{"label": "angle", "digits": 3, "unit": None}]
    assert view["labs"][1]["seconds"] == 20


def test_the_lab_of_a_prediction_is_only_announced() -> None:
    question = QUIZ.questions[2]
    view = student_view(QUIZ, QUIZ.default_policy)["questions"][2]
    assert view["has_lab"] is True
    assert "controls" not in json.dumps(view)
    lab = kind_of(question).lab(question)
    assert lab is not None
    assert lab_view(lab)["controls"][0]["label"] == "push"
