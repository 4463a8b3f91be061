"""The page of one exercise: the statement; the editor, the attempts, the newest verdict and what is under way."""

import difflib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from grader.errors import NotFound
from grader.library import Library
from grader.library.lesson_ids import find_lesson_id
from grader.questions import Quiz
from grader.web.learner.lesson import WITH_AN_INSTRUCTOR, AskedQuestion, TypedAnswer, describe_question, list_facts
from grader.web.text.lessons import describe_lesson
from grader.web.text.numbers import write_points
from grader.web.text.questions import describe_quiz
from grader.web.verdict.card import build_card
from grader.web.verdict.work import GivenAnswer, Work

LINES_MAX = 2000
"""Longer scripts stand side by side without marks: to compare takes a time that grows with the square."""


BESIDE, LISTED_MAX = 3, 100
"""Attempts that the page always shows, and those that it shows at most when the earlier ones are unfolded."""


@dataclass(frozen=True)
class SourceLine:
    """A line of one of two scripts; `kind` is `same`, `changed`, or `gap` where only the other has a line."""

    text: str
    kind: str


def build_exercise_page(
    library: Library, quiz: Quiz, question_id: str, work: Work, attempts: Sequence[GivenAnswer], *,
    chosen: str | None = None, typed: TypedAnswer | None = None,
) -> dict[str, Any]:  # fmt: skip
    """Returns the variables of exercise.html. `chosen` is the id of the attempt to show. Raises NotFound."""
    views = describe_quiz(library, quiz)["questions"]
    at = next(index for index, view in enumerate(views) if view["id"] == question_id)
    view = views[at]
    here = describe_question(view, library.question(quiz.id, question_id), quiz.id, work, typed)
    running = attempts[0] if attempts and attempts[0].verdict is None else None
    shown = choose_attempt(attempts, chosen)
    facts = {name: value for name, value in list_facts([quiz], work).items() if name != WITH_AN_INSTRUCTOR}
    lesson = find_lesson_id(quiz.id)
    return {
        "quiz": {"id": quiz.id, "title": quiz.title},
        "lesson": {"id": lesson, "title": describe_lesson(lesson), "path": f"/lessons/{lesson}"},
        "here": here,
        "facts": facts | {"points": describe_points(here)},  # what waits may be at other questions
        "attempts": attempts,
        "earlier": choose_listed(attempts[BESIDE:], shown),
        "shown": shown,
        "following": find_following(quiz.id, lesson, views[at + 1 :]),
        "running": running,
        "card": None if shown is None else build_card(shown),
        "source": choose_source(here, typed),
    }


def find_following(quiz: str, lesson: str, later: Sequence[Mapping[str, Any]]) -> dict[str, str] | None:
    """Returns the name and the address of the quiz's next question; None after the last."""
    if not later:
        return None
    view = later[0]
    on_lesson = f"/lessons/{lesson}#{quiz}--{view['id']}"
    return {"short": view["short"], "path": view["path"] if view["is_script"] else on_lesson}


def choose_attempt(attempts: Sequence[GivenAnswer], chosen: str | None) -> GivenAnswer | None:
    """The chosen attempt, else the newest with a verdict. Raises NotFound if the learner has no such attempt."""
    if chosen is None:
        return next((attempt for attempt in attempts if attempt.is_whole and attempt.verdict is not None), None)
    chosen_attempt = next((attempt for attempt in attempts if attempt.id == chosen), None)
    if chosen_attempt is None:
        raise NotFound("You have no such attempt at this exercise.")
    return chosen_attempt


def choose_listed(earlier: Sequence[GivenAnswer], shown: GivenAnswer | None) -> list[GivenAnswer]:
    """Returns the earlier attempts that the page lists: the newest, the first of the best, and those with comments."""
    best = max(reversed(earlier), key=lambda attempt: (attempt.is_decided, attempt.counted), default=None)
    listed = {attempt.id for attempt in (*earlier[:LISTED_MAX], best, shown) if attempt is not None}
    return [attempt for attempt in earlier if attempt.id in listed or attempt.comments]


def choose_source(here: AskedQuestion, typed: TypedAnswer | None) -> str:
    """Returns the text of the editor: what was refused, the newest attempt, else the starter."""
    return here.value() if typed is not None else here.value() or here.view["starter"] or ""


def describe_points(here: AskedQuestion) -> str:
    """Returns the points that count at this exercise."""
    place = here.place
    if place.points is None or (place.needs_review and not place.points):
        return f"none of {write_points(place.of)} yet"
    return f"{write_points(place.points)} of {write_points(place.of)}"


def align_scripts(left: str, right: str) -> tuple[list[SourceLine], list[SourceLine]]:
    """Two scripts line by line, with gaps so that equal lines stand beside each other."""
    olds, news = left.splitlines(), right.splitlines()
    pair: tuple[list[SourceLine], list[SourceLine]] = ([], [])
    if len(olds) + len(news) > LINES_MAX:
        return [SourceLine(text, "same") for text in olds], [SourceLine(text, "same") for text in news]
    matcher = difflib.SequenceMatcher(None, olds, news)
    for tag, a, b, c, d in matcher.get_opcodes():
        kind = "same" if tag == "equal" else "changed"
        for lines, part in zip(pair, (olds[a:b], news[c:d]), strict=True):
            lines.extend(SourceLine(text, kind) for text in part)
            lines.extend([SourceLine("", "gap")] * (max(b - a, d - c) - len(part)))
    return pair
