"""The lesson page: what counts and what is due, a rail of questions, and every question with the learner's work."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from markupsafe import Markup

from grader.courses.rules.policy import before_opening
from grader.library import Library
from grader.library.lesson_text import Heading, LessonText, Placement, Prose
from grader.questions import FIELD, Fields, Question, Quiz, fill_form, kind_of, show_answer
from grader.web.text.lab_box import describe_lab
from grader.web.text.lessons import Lesson
from grader.web.text.moments import format_day
from grader.web.text.numbers import write_points
from grader.web.text.prose import cached_prose
from grader.web.text.questions import describe_quiz, describe_unopened
from grader.web.verdict.card import Card, build_card, format_count
from grader.web.verdict.work import QuestionPlace, Work, describe_counting

WITH_AN_INSTRUCTOR = "with an instructor"

DUES_MAX = 2
"""Dates that a lesson shows where its quizzes are due at different times."""


@dataclass(frozen=True)
class TypedAnswer:
    """What a learner sent that was not taken, and why; it is shown again."""

    quiz: str
    question: str
    fields: Fields
    why: str


@dataclass(frozen=True)
class AskedQuestion:
    """A question with the learner's place at it: `view` is its wording, `fields` what its form holds. `lab` is the lab
    of a prediction, once the learner may run it."""

    view: dict[str, Any]
    place: QuestionPlace
    card: Card | None
    fields: Fields
    trouble: str
    lab: dict[str, Any] | None

    @property
    def after(self) -> str:
        """The newest answer when the form was made: a form that is sent twice makes one submission."""
        return "" if self.place.given is None else self.place.given.id

    def value(self, name: str = FIELD) -> str:
        """Returns the value of a field of the form; of a repeated field, the first."""
        return next(iter(self.values(name)), "")

    def values(self, name: str = FIELD) -> Sequence[str]:
        """Returns the values of a field of the form, such as the checked boxes of that name."""
        return self.fields.get(name, ())


def describe_question(
    view: dict[str, Any], question: Question, quiz: str, work: Work, typed: TypedAnswer | None
) -> AskedQuestion:
    """Returns one question as it stands."""
    place = work.places[quiz, question.id]
    given = place.given
    refused = typed is not None and (typed.quiz, typed.question) == (quiz, view["id"])
    kind = kind_of(question)
    fields: Fields = {} if given is None else fill_form(question, given.answer)
    trouble = ""
    if refused and typed is not None:
        fields, trouble = typed.fields, typed.why
    lab = kind.lab(question) if place.lab_is_open else None
    card = None if given is None else build_card(given)
    box = None if lab is None or given is None else preset_lab(describe_lab(lab), show_answer(question, given.answer))
    return AskedQuestion(view, place, card, fields, trouble, box)


def preset_lab(box: dict[str, Any], chosen: str) -> dict[str, Any]:
    """Returns a lab whose selects begin with the option that the learner predicted, where they offer it."""
    controls = [
        control | {"value": dict(control["options"])[chosen]}
        if control["type"] == "select" and chosen in dict(control["options"])
        else control
        for control in box.get("controls", ())
    ]
    return box | {"controls": controls}


def build_section(library: Library, quiz: Quiz, work: Work, typed: TypedAnswer | None = None) -> dict[str, Any]:
    """Returns one quiz for the template, as the learner may see it now."""
    if not work.access.has_opened(quiz.id):
        return describe_unopened(quiz, before_opening(work.access.policies[quiz.id], work.access.at) or "")
    page = describe_quiz(library, quiz)
    got, of = work.points(quiz)
    pairs = zip(page["questions"], quiz.questions, strict=True)
    questions = [describe_question(view, question, quiz.id, work, typed) for view, question in pairs]
    dates = next(filter(None, (question.place.dates for question in questions)), "")
    return page | {"questions": questions, "got": got, "of": of, "dates": dates}


def build_lesson_page(library: Library, lesson: Lesson, work: Work, typed: TypedAnswer | None = None) -> dict[str, Any]:
    """Returns the variables of lesson.html."""
    sections = [build_section(library, quiz, work, typed) for quiz in lesson.quizzes]
    link_unknown_labs(sections, lesson.text.source if lesson.text else "")
    return {
        "lesson": lesson,
        "name": lesson.name,
        "summary": cached_prose(lesson.head.summary) if lesson.head and lesson.head.summary else "",
        "facts": list_opened_facts(lesson.quizzes, work),
        "first": find_first(sections),
        "quizzes": sections,
        **arrange_parts(lesson.text, sections),
    }


def link_unknown_labs(sections: Sequence[Mapping[str, Any]], source: str) -> None:
    """Gives labs that do not run here the address of the page that the lesson was imported from."""
    for section in sections:
        for lab in section.get("labs", ()):
            lab["source"] = source


def arrange_parts(text: LessonText | None, sections: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Returns the `parts` of the page from top to bottom, and its `outline`: the author's text with quizzes and labs in
    their places, then what the text does not place. A placed lab is shown there alone, and never before its quiz opens.
    """
    placed = [part for part in text.parts if isinstance(part, Placement)] if text else []
    shown = {section["id"]: section | {"labs": leave_out(section, placed)} for section in sections}
    whole = {section["id"]: section for section in sections}
    parts: list[dict[str, Any]] = []
    outline: list[dict[str, Any]] = []
    for part in text.parts if text else ():
        if isinstance(part, Heading):
            heading = {"sort": "heading", "level": part.level, "anchor": part.anchor, "html": cached_prose(part.html)}
            parts.append(heading)
            outline += [heading] * (part.level == 2)
        elif isinstance(part, Prose):
            parts.append({"sort": "prose", "html": Markup().join(map(cached_prose, part.blocks))})
        elif part.quiz in whole:
            parts += place_part(part, whole[part.quiz], shown[part.quiz])
    texts = {part.quiz for part in placed if not part.lab}
    rest = [section for name, section in shown.items() if name not in texts]
    parts += [{"sort": "quiz", "quiz": quiz} for quiz in rest if quiz["questions"] or quiz["labs"] or not placed]
    return {"parts": parts, "outline": outline}


def leave_out(section: Mapping[str, Any], placed: Sequence[Placement]) -> list[dict[str, Any]]:
    """Returns the labs of a quiz that the text of the lesson does not place elsewhere."""
    return [lab for lab in section["labs"] if Placement(section["id"], lab["id"]) not in placed]


def place_part(part: Placement, whole: dict[str, Any], shown: dict[str, Any]) -> list[dict[str, Any]]:
    """Returns a quiz or lab where the author put it; of an unopened quiz, when it opens."""
    if not part.lab:
        return [{"sort": "quiz", "quiz": shown}]
    if whole.get("opens"):
        return [{"sort": "unopened", "opens": whole["opens"]}]
    return [{"sort": "lab", "quiz": whole, "lab": lab} for lab in whole["labs"] if lab["id"] == part.lab]


@dataclass(frozen=True)
class First:
    """What to do first: the first question without an answer that takes one. `has_begun`: some question has one."""

    quiz: str
    title: str
    number: int
    asked: AskedQuestion
    has_begun: bool


def find_first(sections: Sequence[Mapping[str, Any]]) -> First | None:
    """Says what to do first; None where no question is left to answer."""
    places = [(section, number, it) for section in sections for number, it in enumerate(section["questions"], 1)]
    has_begun = any(it.place.given is not None for _, _, it in places)
    for section, number, it in places:
        if it.place.given is None and it.place.may_answer:
            return First(section["id"], section["title"], number, it, has_begun)
    return None


def list_opened_facts(quizzes: Sequence[Quiz], work: Work) -> dict[str, str]:
    """Returns the facts of the quizzes that have opened; before the first of them, when it opens."""
    unopened = [work.access.policies[quiz.id] for quiz in quizzes if not work.access.has_opened(quiz.id)]
    coming = [policy.opens for policy in unopened if policy.opens]
    if coming and len(coming) == len(quizzes):
        return {"opens": format_day(min(coming))}
    return list_facts([quiz for quiz in quizzes if work.access.has_opened(quiz.id)], work)


def list_facts(quizzes: Iterable[Quiz], work: Work) -> dict[str, str]:
    """Points so far, what counts, and what is due next."""
    with_questions = [quiz for quiz in quizzes if quiz.questions]
    if not with_questions:
        return {}
    sums = [work.points(quiz) for quiz in with_questions]
    got, of = (sum(column) for column in zip(*sums, strict=True))
    counts = dict.fromkeys(describe_counting(work.access.policies[quiz.id]) for quiz in with_questions)
    places = [work.places[quiz.id, question.id] for quiz in with_questions for question in quiz.questions]
    facts = {"points": describe_sum(places, got, of)}
    if waiting := sum(place.of for place in places if place.needs_review and not place.points):
        facts[WITH_AN_INSTRUCTOR] = format_count(waiting, "point")
    facts["what counts"] = ", ".join(counts)
    if any(place.may_answer for place in places) and all(place.attempts_left is None for place in places):
        facts["attempts"] = "no limit"
    dues = [place.due for place in places if place.due is not None]
    coming = sorted({due for due in dues if due > work.access.at})
    if coming:
        facts["due"] = ", then ".join(map(format_day, coming[:DUES_MAX])) + (" …" if len(coming) > DUES_MAX else "")
    elif dues:
        decisions = (work.access.decide(quiz.id, question.id) for quiz in with_questions for question in quiz.questions)
        closings = [decision.closes for decision in decisions if decision.why_not is None and decision.closes]
        late = f", late answers until {format_day(max(closings))}" if closings else ""
        over = sum(any(work.places[quiz.id, question.id].due for question in quiz.questions) for quiz in with_questions)
        part = f"{over} of {len(with_questions)} quizzes " if over < len(with_questions) else ""
        facts["due"] = f"{part}over since {format_day(max(dues))}{late}"
    return facts


def describe_sum(places: Sequence[QuestionPlace], got: float, of: float) -> str:
    """Says how many points of how many there are, as far as they may be seen."""
    if not any(place.given is not None and place.given.withheld for place in places):
        return f"{write_points(got)} of {write_points(of)}"
    shown = f"{write_points(got)} so far, others" if any(place.points is not None for place in places) else ""
    return f"{shown} not shown yet, of {write_points(of)}".strip()
