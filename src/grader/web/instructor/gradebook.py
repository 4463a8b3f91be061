"""`/instructor/gradebook`: what counts, of one quiz or of all. No script."""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

from fastapi import Query, Request
from fastapi.responses import Response
from sqlalchemy.orm import Session

from grader.courses.people.identity import Identity
from grader.courses.people.namesakes import make_marks
from grader.courses.reviewing.blinding import find_unseen
from grader.courses.rules.gradebook import Form
from grader.domain.pages.markup import plain_text
from grader.domain.verdict import Status
from grader.gate.late_routes import page_router
from grader.gate.services import AppServices
from grader.library import Library
from grader.questions import Quiz
from grader.store import people, results
from grader.store.results import ORDERS, SHOWS, LearnerAt, QuizSum, Ranking
from grader.web.frame.inputs import Visitor
from grader.web.frame.rendering import page
from grader.web.learner.pages import show_sign_in
from grader.web.text.questions import list_titles
from grader.web.text.statuses import NOT_ANSWERED, SECOND_MARK, STATUSES, WAITS, Badge

PAGE = "/instructor/gradebook"
ROWS = 100
"""Learners on one page."""
ABSENT = 200
"""Learners who have not begun that are named."""
POINTS_EQUAL = 1e-9
"""Points that differ by less are equal: 0.1 + 0.2 is 0.3."""

LEGEND = (*(STATUSES[status] for status in (Status.CORRECT, Status.PARTIAL, Status.INCORRECT)), WAITS, NOT_ANSWERED)
SHOWN = dict(zip(SHOWS, ("everyone", "who waits for a verdict", "who has not answered everything"), strict=True))
FORMS = {Form.GENERIC: "CSV", Form.CANVAS: "CSV for Canvas", Form.MOODLE: "CSV for Moodle"}

router = page_router()


class ResultCell(NamedTuple):
    """A result in words. Without points it is not late either."""

    badge: Badge
    points: float | None = None
    max_points: float = 0.0
    is_late: bool = False


EMPTY = ResultCell(NOT_ANSWERED)


class QuizCell(NamedTuple):
    """A learner's sum in a quiz: points, and how many of its questions are answered."""

    points: float
    answered: int
    waits: bool
    of: float
    questions: int


class Column(NamedTuple):
    """A question, or a quiz, whose own gradebook has the address."""

    name: str
    title: str
    whole_title: str
    of: float
    address: str = ""


@dataclass(frozen=True)
class GradebookRow:
    """A learner with a cell for every column, the number of results, and the points with what they are out of."""

    learner: str
    name: str
    cells: Sequence[ResultCell | QuizCell]
    answered: int
    points: float
    of: float


Name = Annotated[str, Query(max_length=64)]


@router.get(PAGE)
def gradebook(
    request: Request, services: AppServices, who: Visitor, *, quiz: Name = "",
    find: Annotated[str, Query(max_length=200)] = "",
    show: Name = SHOWS[0], by: Name = ORDERS[0], down: bool = False, start: Annotated[int, Query(ge=0, lt=10**6)] = 0,
) -> Response:  # fmt: skip
    """Learners by quizzes of the course, or by questions of one `quiz`; anyone but an instructor is told to sign in."""
    if who is None or not who.is_instructor:
        return show_sign_in(request, services, who)
    library = services.library_for(who)
    quizzes = library.list_asking()
    if not quizzes:
        return page(request, "gradebook.html", who=who, quizzes=[])
    chosen = [library.quiz(quiz)] if quiz else quizzes
    shown = {"find": find, "show": show if show in SHOWS else SHOWS[0]}
    order = {"by": by if by in ORDERS else ORDERS[0], "descending": down}
    with services.database.read() as session:
        averaged = services.desk_of(who.course).list_averaged(session, who.course)
        rows = list_rows(session, who, chosen, start, averaged, **shown, **order)
        absent = people.list_without_results(session, who.course, [entry.id for entry in chosen], find, ABSENT + 1)
        marks, removed = make_marks(session, who.course), people.list_removed(session, who.course)
    columns = list_questions(library, chosen[0]) if len(chosen) == 1 else list_quizzes(chosen)
    context: dict[str, Any] = {
        **shown,
        **order,
        "quizzes": quizzes,
        "quiz": chosen[0] if len(chosen) == 1 else None,
        "columns": columns,
        "of": math.fsum(column.of for column in columns),
        "rows": rows[:ROWS],
        "absent": absent[:ABSENT],
        "more_absent": len(absent) > ABSENT,
        "following": start + ROWS if len(rows) > ROWS else None,
        "shows": SHOWN,
        "legend": LEGEND,
        "forms": FORMS,
        "marks": marks,
        "removed": removed,
    }
    return page(request, "gradebook.html", who=who, **context)


def list_questions(library: Library, quiz: Quiz) -> list[Column]:
    """A column for every question of a quiz."""
    titles = list_titles(library)
    return [
        Column(question.id, titles[quiz.id, question.id], plain_text(question.title or question.q), question.points)
        for question in quiz.questions
    ]


def list_quizzes(quizzes: Sequence[Quiz]) -> list[Column]:
    """A column for every quiz."""
    return [
        Column(quiz.id, title, title, sum_points(quiz), f"{PAGE}?quiz={quiz.id}")
        for quiz in quizzes
        for title in [plain_text(quiz.title)]
    ]


def sum_points(quiz: Quiz) -> float:
    """Returns the points of a quiz."""
    return math.fsum(question.points for question in quiz.questions)


def list_rows(
    session: Session, who: Identity, quizzes: Sequence[Quiz], start: int, averaged: Collection[str], **wanted: Any
) -> list[GradebookRow]:
    """Returns one learner more than a page has. In the quizzes `averaged` all attempts count."""
    without, unseen = results.list_instructors(session, who.course), find_unseen(session, who).results
    reviewer = who.id if unseen else ""
    asked = {quiz.id: {question.id for question in quiz.questions} for quiz in quizzes}
    ranking = Ranking(who.course, asked, without, reviewer=reviewer, **wanted)
    ranked = results.rank_learners(session, ranking, start, ROWS + 1)
    learners = [learner for learner, _ in ranked]
    if len(quizzes) == 1:
        theirs = results.find_of_learners(session, who.course, quizzes[0].id, learners)
        right = results.find_right_but_late(session, who.course, learners, averaged)
        return [make_row(learner, name, theirs[learner], quizzes[0], unseen, right=right) for learner, name in ranked]
    sums = results.sums_of_learners(session, ranking, learners)
    hidden = {(at.learner, at.quiz) for at in unseen if at.question in asked.get(at.quiz, ())}
    maxima = read_maxima(session, who.course, quizzes, sums)
    return [sum_row(learner, name, sums[learner], quizzes, hidden, maxima=maxima) for learner, name in ranked]


def read_maxima(
    session: Session, course: str, quizzes: Sequence[Quiz], sums: Mapping[str, Mapping[str, QuizSum]]
) -> dict[tuple[str, str], float]:
    """Returns what sums are out of, by learner and quiz, at the quizzes where one is more than its questions have now:
    they had more points before. To read the maxima of all results would take as long as to read the results."""
    maxima: dict[tuple[str, str], float] = {}
    for quiz in quizzes:
        worth = sum_points(quiz) + POINTS_EQUAL
        learners = [learner for learner, own in sums.items() if quiz.id in own and own[quiz.id].points > worth]
        if learners:
            theirs = results.find_of_learners(session, course, quiz.id, learners)
            maxima |= {(learner, quiz.id): sum_maxima(quiz, theirs[learner]) for learner in learners}
    return maxima


def sum_maxima(quiz: Quiz, theirs: Sequence[Any]) -> float:
    """Returns what a learner's results are out of, with the points of the questions that have none of theirs yet."""
    at = {result.question: result.max_points for result in theirs if result.is_final or result.points}
    return math.fsum(at.get(question.id, question.points) for question in quiz.questions)


def sum_row(
    learner: str, name: str, theirs: Mapping[str, QuizSum], quizzes: Sequence[Quiz],
    hidden: Collection[tuple[str, str]], *, maxima: Mapping[tuple[str, str], float],
) -> GradebookRow:  # fmt: skip
    """A learner with the sum of each quiz. Where a first mark is `hidden`, by learner and quiz, an answer waits.
    `maxima` has what a sum is out of where that is not what the questions have now."""
    worth = {quiz.id: maxima.get((learner, quiz.id)) or sum_points(quiz) for quiz in quizzes}
    cells = [
        QuizCell(
            own.points, own.answered, own.waits or (learner, quiz.id) in hidden, worth[quiz.id], len(quiz.questions)
        )
        if (own := theirs.get(quiz.id))
        else EMPTY
        for quiz in quizzes
    ]
    several = theirs.values()
    points, answered = math.fsum(total.points for total in several), sum(total.answered for total in several)
    return GradebookRow(learner, name, cells, answered, points, math.fsum(worth.values()))


def make_row(
    learner: str, name: str, theirs: Sequence[Any], quiz: Quiz, unseen: Collection[LearnerAt], *,
    right: Collection[LearnerAt],
) -> GradebookRow:  # fmt: skip
    """A learner with the results at the questions that a quiz still has; what is `unseen` adds no points."""
    at = {result.question: result for result in theirs}
    own = [at.get(question.id) for question in quiz.questions]
    counted = [result for result in own if result is not None]
    points = math.fsum(result.points for result in counted if not is_in(unseen, result))
    cells = [EMPTY if result is None else make_cell(result, unseen, right) for result in own]
    return GradebookRow(learner, name, cells, len(counted), points, sum_maxima(quiz, counted))


def make_cell(result: Any, unseen: Collection[LearnerAt], right: Collection[LearnerAt]) -> ResultCell:
    """Returns a result in words: what is not final waits, whatever its points are, and what is `unseen` for a second
    mark. What is `right` is correct also where it was late and lost points by that."""
    if is_in(unseen, result):
        return ResultCell(SECOND_MARK)
    if not (result.is_final or result.points):
        return ResultCell(WAITS)
    if not result.is_final:
        badge = WAITS
    elif result.points >= result.max_points - POINTS_EQUAL or is_in(right, result):
        badge = STATUSES[Status.CORRECT]
    else:
        badge = STATUSES[Status.PARTIAL] if result.points > 0 else STATUSES[Status.INCORRECT]
    return ResultCell(badge, result.points, result.max_points, result.is_late)


def is_in(places: Collection[LearnerAt], result: Any) -> bool:
    """Says whether a result is at one of some places, as of first marks that a reviewer must not see yet; there are
    seldom any."""
    return bool(places) and LearnerAt(result.course, result.learner, result.quiz, result.question) in places
