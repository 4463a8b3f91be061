"""`/instructor/gradebook` and `/instructor/learners/{id}`: what counts, and a learner's whole story. No script."""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Annotated, Any, NamedTuple

from fastapi import APIRouter, Query, Request
from fastapi.responses import Response

from grader.courses.people.identity import Identity
from grader.courses.people.namesakes import marks_in
from grader.courses.reviewing.blinding import blinded, unseen_by
from grader.courses.rules.gradebook import Form
from grader.domain.markup import plain_text
from grader.domain.verdict import Status
from grader.errors import NotFound
from grader.gate.services import AppServices, Services
from grader.library import Library
from grader.questions import Question, Quiz, kind_of
from grader.store import people, results, submissions
from grader.store.results import ORDERS, SHOWS, LearnerAt, Ranking
from grader.store.submissions import SubmissionFilter
from grader.web.frame.inputs import Instructor, Visitor
from grader.web.frame.rendering import page
from grader.web.instructor.people import describe_origin
from grader.web.instructor.quiz_choice import choose_quiz
from grader.web.learner.pages import show_sign_in
from grader.web.text.lessons import group_lessons
from grader.web.text.questions import list_titles
from grader.web.text.statuses import NOT_ANSWERED, REPLACED, STATUSES, WAITS, Badge
from grader.web.verdict.work import Given, read_in_full

PAGE = "/instructor/gradebook"
ROWS = 100
"""Learners on one page."""
ABSENT = 200
"""Learners who have not begun that are named."""
ANSWERS = 100
"""Answers of a learner's story on one page."""
POINTS_EQUAL = 1e-9
"""Points that differ by less are equal: 0.1 + 0.2 is 0.3."""

LEGEND = (*(STATUSES[one] for one in (Status.CORRECT, Status.PARTIAL, Status.INCORRECT)), WAITS, NOT_ANSWERED)
SHOWN = dict(zip(SHOWS, ("everyone", "who waits for a verdict", "who has not answered everything"), strict=True))
FORMS = {Form.GENERIC: "CSV", Form.CANVAS: "CSV for Canvas", Form.MOODLE: "CSV for Moodle"}

router = APIRouter(include_in_schema=False)


class Cell(NamedTuple):
    """A result in words. Without points it is not late either."""

    badge: Badge
    points: float | None = None
    max_points: float = 0.0
    is_late: bool = False


EMPTY = Cell(NOT_ANSWERED)


@dataclass(frozen=True)
class Row:
    """A learner in a quiz: a cell for every question, at how many there is a result, and the points."""

    learner: str
    name: str
    cells: Sequence[Cell]
    answered: int
    points: float


Name = Annotated[str, Query(max_length=64)]


@router.get(PAGE)
def gradebook(
    request: Request, services: AppServices, who: Visitor, *, quiz: Name = "",
    find: Annotated[str, Query(max_length=200)] = "",
    show: Name = SHOWS[0], by: Name = ORDERS[0], down: bool = False, start: Annotated[int, Query(ge=0, lt=10**6)] = 0,
) -> Response:  # fmt: skip
    """Learners by questions of one quiz, the last answered by default; anyone but an instructor is told to sign in."""
    if who is None or not who.is_instructor:
        return show_sign_in(request, services, who)
    quizzes = [one for one in services.library_for(who).quizzes.values() if one.questions]
    if not quizzes:
        return page(request, "gradebook.html", who=who, quizzes=[])
    chosen = choose_quiz(services, who, quizzes, quiz)
    shown = {"find": find, "show": show if show in SHOWS else SHOWS[0]}
    order = {"by": by if by in ORDERS else ORDERS[0], "descending": down}
    rows = list_rows(services, who, chosen, start, **shown, **order)
    with services.database.read() as session:
        absent = people.without_results(session, who.course, [chosen.id], shown["find"], ABSENT + 1)
        marks = marks_in(session, who.course)
    titles = list_titles(services.library_for(who))
    context: dict[str, Any] = {
        **shown,
        **order,
        "quizzes": quizzes,
        "quiz": chosen,
        "titles": [(one.id, titles[chosen.id, one.id], plain_text(one.title or one.q)) for one in chosen.questions],
        "of": sum(one.points for one in chosen.questions),
        "rows": rows[:ROWS],
        "absent": absent[:ABSENT],
        "more_absent": len(absent) > ABSENT,
        "following": start + ROWS if len(rows) > ROWS else None,
        "shows": SHOWN,
        "legend": LEGEND,
        "forms": FORMS,
        "marks": marks,
    }
    return page(request, "gradebook.html", who=who, **context)


def list_rows(services: Services, who: Identity, quiz: Quiz, start: int, **wanted: Any) -> list[Row]:
    """Returns one learner more than a page has."""
    with services.database.read() as session:
        without, unseen = results.instructors(session, who.course), unseen_by(session, who).results
        reviewer = who.id if unseen else ""
        ranking = Ranking(who.course, quiz.id, len(quiz.questions), without, reviewer=reviewer, **wanted)
        found = results.ranked(session, ranking, start, ROWS + 1)
        theirs = results.of_learners(session, who.course, quiz.id, [learner for learner, _ in found])
    return [make_row(learner, name, theirs[learner], quiz, unseen) for learner, name in found]


def make_row(learner: str, name: str, theirs: Sequence[Any], quiz: Quiz, unseen: Collection[LearnerAt]) -> Row:
    """A learner with all results in a quiz, also at questions that it has lost; what is `unseen` adds no points."""
    cells = {one.question: make_cell(one, unseen) for one in theirs}
    points = math.fsum(one.points for one in theirs if not is_in(unseen, one))
    return Row(learner, name, [cells.get(question.id, EMPTY) for question in quiz.questions], len(theirs), points)


def make_cell(result: Any, unseen: Collection[LearnerAt]) -> Cell:
    """Returns a result in words: what is not final waits, whatever its points are, and so does what is `unseen`."""
    if is_in(unseen, result) or not (result.is_final or result.points):
        return Cell(WAITS)
    if not result.is_final:
        badge = WAITS
    elif result.points >= result.max_points - POINTS_EQUAL:
        badge = STATUSES[Status.CORRECT]
    else:
        badge = STATUSES[Status.PARTIAL] if result.points > 0 else STATUSES[Status.INCORRECT]
    return Cell(badge, result.points, result.max_points, result.is_late)


def is_in(unseen: Collection[LearnerAt], result: Any) -> bool:
    """Says whether a result is a first mark that this reviewer must not see yet; there are seldom any."""
    return bool(unseen) and LearnerAt(result.course, result.learner, result.quiz, result.question) in unseen


@router.get("/instructor/learners/{learner}")
def story(
    request: Request, learner: str, services: AppServices, who: Instructor, *,
    before: Annotated[str, Query(max_length=32)] = "",
) -> Response:  # fmt: skip
    """Every answer of a learner with its verdict, by question; of those under review without a name, how many. Raises
    Unauthorized, Forbidden, NotFound."""
    desk = services.desk_of(who.course)
    with services.database.read() as session:
        wanted = SubmissionFilter(who.course, learner=learner)
        rows = submissions.page(session, wanted, before or None, ANSWERS + 1)
        member = people.get(session, learner, who.course)
        if member is None and not rows:
            raise NotFound("There is no such learner.")
        averaged = desk.list_averaged(session, who.course)
        seen = blinded(desk, session, who, rows, submissions.verdicts(session, rows))
        counts = results.everywhere(session, who.course, learner)
        unseen = unseen_by(session, who).results
        shown = [(row, read_in_full(row, seen.verdicts.get(row.id))) for row in rows[:ANSWERS]]
        marks = marks_in(session, who.course)
    given = [(row.quiz, row.question, None if row.id in seen.names else one) for row, one in shown]
    cells = {at: make_cell(result, unseen) for at, result in counts.items()}
    name = member.name if member is not None else rows[0].user
    parts = group_answers(desk.library, given, cells, averaged)
    following = rows[ANSWERS - 1].id if len(rows) > ANSWERS else None
    counted = [one for one in counts.values() if not is_in(unseen, one) and (one.is_final or one.points)]
    total = (sum(one.points for one in counted), sum(one.max_points for one in counted))
    return page(
        request, "learner.html", who=who, learner=learner, name=name, parts=parts, following=following,
        total=total, member=member, origin="" if member is None else describe_origin(member), marks=marks,
        lessons=group_lessons(desk.library),
    )  # fmt: skip


def group_answers(
    library: Library, given: Sequence[tuple[str, str, Given | None]], cells: Mapping[tuple[str, str], Cell],
    averaged: Collection[str],
) -> list[dict[str, Any]]:  # fmt: skip
    """Returns the answers by question, in the order of the content; questions that it has lost come last. None stands
    for an answer that bears a pseudonym for its reviewers. In the quizzes `averaged` all attempts count."""
    titles = list_titles(library)
    questions = {(quiz.id, one.id): one for quiz in library.quizzes.values() for one in quiz.questions}
    places = {at: place for place, at in enumerate(questions)}

    def place(one: tuple[str, str, Given | None]) -> tuple[int, str, str]:
        return places.get(one[:2], len(places)), one[0], one[1]

    return [
        {
            "quiz": at[1],
            "question": at[2],
            "title": titles.get((at[1], at[2]), at[2]),
            "cell": cells.get((at[1], at[2]), EMPTY),
            "answers": [
                (
                    answer,
                    show_answer(questions.get((at[1], at[2])), answer),
                    describe_state(answer, waits=place == 0 or at[1] in averaged),
                )
                for place, answer in enumerate(answers)
                if answer is not None
            ],
            "blind": answers.count(None),
        }
        for at, theirs in groupby(sorted(given, key=place), key=place)
        for answers in [[answer for _, _, answer in theirs]]
    ]


def show_answer(question: Question | None, given: Given) -> str:
    """Returns an answer in words; as it was typed where the content has lost the question."""
    return given.text if question is None else kind_of(question).show(question, given.answer)


def describe_state(given: Given, *, waits: bool) -> Badge:
    """Returns the state of an answer: an earlier one no longer `waits` for a person, unless all attempts count."""
    return given.badge if waits or given.is_decided or given.verdict is None else REPLACED
