"""How a question is worded for the page."""

from typing import Any

import pytest

from grader.library import Library
from grader.questions import Quiz
from grader.web.learner.exercise import find_following
from grader.web.text.questions import describe_quiz, describe_worth, render_prompt, shorten_title

QUESTION: dict[str, Any] = {"id": "f", "kind": "code", "q": "Write $f$.", "entry": "f", "check": {"kind": "none"}}


def card(**changes: Any) -> dict[str, Any]:
    quiz = Quiz.model_validate({"id": "quiz", "title": "A <b>quiz</b>", "questions": [QUESTION | changes]})
    library = Library(root=None, quizzes={}, starters={"s/f.py": "def f(): ..."})  # type: ignore[arg-type]
    page = describe_quiz(library, quiz)
    assert page["title"] == "A quiz"
    shown: dict[str, Any] = page["questions"][0]
    return shown


@pytest.mark.parametrize(
    ("points", "attempts", "text"),
    [
        (1.0, None, "1 point"),
        (2.5, None, "2.5 points"),
        (3.0, 1, "3 points, 1 attempt"),
        (1.0, 5, "1 point, 5 attempts"),
    ],
)
def test_what_a_question_is_worth(points: float, attempts: int | None, text: str) -> None:
    assert describe_worth(points, attempts) == text


@pytest.mark.parametrize(
    ("text", "html"),
    [
        ("Which <code>x</code>?", "<p>Which <code>x</code>?</p>"),
        ("<p>One.</p><p>Two.</p>", "<p>One.</p><p>Two.</p>"),
        ("<pre>x</pre>", "<pre>x</pre>"),
        ("<private>", "<p></p>"),
    ],
)
def test_a_prompt_is_paragraphs(text: str, html: str) -> None:
    assert render_prompt(text) == html


@pytest.mark.parametrize(
    ("text", "short"),
    [
        ("How long is the limit at 2 ms?", "How long is the limit at 2\u202fms?"),
        (
            "The pendulum is held by a stiff servo (kp = 20000) at 10 ms.",
            "The pendulum is held by a stiff servo at…",
        ),
        (
            "A servo of $k_p = {40}$ N m/rad holds a pendulum at 0.65 rad.",
            "A servo of kp = 40\u202fN\u00a0m/rad holds a pendulum…",
        ),
        (
            "Your arm holds every target in simulation. On the robot it hums.",
            "Your arm holds every target in simulation…",
        ),
        (
            "Why does the servo grow at 20 ms although 2 ms is stable?",
            "Why does the servo grow at 20\u202fms although…",
        ),
        ("(" * 60, "(" * 44 + "…"),
        (r"Is $\mu = 0.4$ or $\Lambda_2 \le \lambda$?", "Is μ = 0.4 or Λ2 ≤ λ?"),
        (
            "A network holds an arm with 120 (1.2 − angle) − 45 rate in N m.",
            "A network holds an arm with…",
        ),
    ],
)
def test_a_question_without_a_title_is_named_by_whole_words(text: str, short: str) -> None:
    assert shorten_title(None, text) == short


def test_headings_come_from_the_author_first() -> None:
    assert card()["heading"] == "Exercise"
    assert card(label="Step <i>2</i>")["heading"] == "Step 2"
    assert card(label="Step 2", title="Runge & Kutta")["heading"] == "Runge & Kutta"


def test_an_exercise_says_what_a_script_may_use_and_shows_its_starter() -> None:
    shown = card(starter="s/f.py", limits={"cpu_s": 2.5, "memory_mb": 300, "output_kb": 8})
    assert shown["allowance"].startswith(
        "A script may use 2.5\u202fs of processor time, 300\u202fMB of memory and 8\u202fKB of output."
    )
    assert shown["starter"] == "def f(): ..."
    assert shown["path"] == "/quizzes/quiz/f"
    assert card()["starter"] is None


def test_after_an_exercise_comes_the_quizs_next_question_on_its_own_page_or_in_the_lesson() -> None:
    code = {"id": "rk4", "kind": "code", "short": "Your own step", "path": "/quizzes/q/rk4", "is_script": True}
    text = {"id": "why", "kind": "open", "short": "Why?", "path": "/quizzes/q/why", "is_script": False}
    assert find_following("q", "1.3", [code, text]) == {"short": "Your own step", "path": "/quizzes/q/rk4"}
    assert find_following("q", "1.3", [text]) == {"short": "Why?", "path": "/lessons/1.3#q--why"}
    assert find_following("q", "1.3", []) is None
