"""The lesson page: what counts and what is due, a rail of questions, and every question with the learner's work."""

from collections.abc import Iterable
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from grader.courses.policy import before_opening
from grader.domain.quiz import PredictQuestion, Question, Quiz
from grader.library import Library
from grader.web.figures import points
from grader.web.lab_box import lab_box
from grader.web.lessons import Lesson
from grader.web.page import page_of, unopened_page
from grader.web.verdict_card import Card, card_of
from grader.web.work import Place, Work, counting


@dataclass(frozen=True)
class Typed:
    """What a learner sent that was not taken, and why; it is shown again."""

    quiz: str
    question: str
    answer: str
    why: str


@dataclass(frozen=True)
class Asked:
    """A question with the learner's place at it: `view` is its wording, `typed` what its field holds.

    `lab` is the lab of a prediction, once the learner may run it.
    """

    view: dict[str, Any]
    place: Place
    card: Card | None
    typed: str
    trouble: str
    lab: dict[str, Any] | None

    @property
    def after(self) -> str:
        """The newest answer when the form was made: a form that is sent twice makes one submission."""
        return "" if self.place.given is None else self.place.given.id


def asked(view: dict[str, Any], question: Question, quiz: str, work: Work, typed: Typed | None) -> Asked:
    """One question as it stands."""
    place = work.places[quiz, question.id]
    given = place.given
    refused = typed is not None and (typed.quiz, typed.question) == (quiz, view["id"])
    text = typed.answer if refused and typed is not None else "" if given is None else given.text
    trouble = typed.why if refused and typed is not None else ""
    lab = question.sim if isinstance(question, PredictQuestion) and place.lab_is_open else None
    card = None if given is None else card_of(given)
    return Asked(view, place, card, text, trouble, None if lab is None else lab_box(lab))


def section_of(library: Library, quiz: Quiz, work: Work, typed: Typed | None = None) -> dict[str, Any]:
    """One quiz for the template, as the learner may see it now."""
    if not work.standing.has_opened(quiz.id):
        return unopened_page(quiz, before_opening(quiz.policy, work.standing.at) or "")
    page = page_of(library, quiz)
    got, of = work.points(quiz)
    pairs = zip(page["questions"], quiz.questions, strict=True)
    questions = [asked(view, question, quiz.id, work, typed) for view, question in pairs]
    return page | {"questions": questions, "got": got, "of": of}


def lesson_page(library: Library, lesson: Lesson, work: Work, typed: Typed | None = None) -> dict[str, Any]:
    """The variables of lesson.html."""
    opened = [quiz for quiz in lesson.quizzes if work.standing.has_opened(quiz.id)]
    return {
        "lesson": lesson,
        "facts": facts_of(opened, work),
        "quizzes": [section_of(library, quiz, work, typed) for quiz in lesson.quizzes],
    }


def facts_of(quizzes: Iterable[Quiz], work: Work) -> dict[str, str]:
    """Points so far, what counts, and what is due next."""
    with_questions = [quiz for quiz in quizzes if quiz.questions]
    if not with_questions:
        return {}
    sums = [work.points(quiz) for quiz in with_questions]
    got, of = (sum(column) for column in zip(*sums, strict=True))
    counts = dict.fromkeys(counting(quiz.policy) for quiz in with_questions)
    facts = {"points": f"{points(got)} of {points(of)}", "what counts": ", ".join(counts)}
    places = [work.places[quiz.id, question.id] for quiz in with_questions for question in quiz.questions]
    dues = [place.due for place in places if place.due is not None]
    coming = [due for due in dues if due > work.standing.at]
    if coming:
        facts["due"] = day(min(coming))
    elif dues:
        facts["due"] = "over"
    return facts


def day(moment: datetime) -> str:
    """A moment for the head of a page: `Fri 27 Nov, 18:00 UTC`."""
    return f"{moment:%a} {moment.day} {moment:%b, %H:%M} UTC"
