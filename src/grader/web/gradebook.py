"""`/instructor/gradebook` and `/instructor/learners/{id}`: what counts, and a learner's whole story. No script."""

from collections.abc import Collection, Mapping, Sequence
from itertools import groupby
from typing import Annotated, Any

from fastapi import APIRouter, Query, Request
from fastapi.responses import Response

from grader.courses.blinding import blinded, unseen_by
from grader.courses.gradebook import Form
from grader.domain.markup import plain_text
from grader.domain.quiz import QuestionPart, Quiz
from grader.domain.verdict import Status
from grader.errors import NotFound
from grader.identity import Identity
from grader.library import Library
from grader.store import people, results, submissions
from grader.store.results import ORDERS, SHOWS, LearnerAt, Ranking
from grader.store.submissions import SubmissionFilter
from grader.store.tables import Result
from grader.web.context import PageContext, Pages, Visitor, instructor
from grader.web.lessons import lessons_of
from grader.web.rendering import page
from grader.web.student_pages import sign_in_page
from grader.web.words import NOT_ANSWERED, PARTLY, STATUSES, UNDECIDED, Told
from grader.web.work import Given, given_in_full

PAGE = "/instructor/gradebook"
ROWS = 100
"""Learners on one page."""
ANSWERS = 100
"""Answers of a learner's story on one page."""
POINTS_EQUAL = 1e-9
"""Points that differ by less are equal: 0.1 + 0.2 is 0.3."""

SHOWN = dict(zip(SHOWS, ("everyone", "who waits for a verdict", "who has not answered everything"), strict=True))
FORMS = {Form.GENERIC: "CSV", Form.CANVAS: "CSV for Canvas", Form.MOODLE: "CSV for Moodle"}

router = APIRouter(include_in_schema=False)

Name = Annotated[str, Query(max_length=64)]


@router.get(PAGE)
def gradebook(
    request: Request, pages: Pages, who: Visitor, *, quiz: Name = "", find: Annotated[str, Query(max_length=200)] = "",
    show: Name = SHOWS[0], by: Name = ORDERS[0], down: bool = False, start: Annotated[int, Query(ge=0, lt=10**6)] = 0,
) -> Response:  # fmt: skip
    """Learners by questions of one quiz, the first without a choice; anyone but an instructor is told to sign in."""
    if who is None or not who.is_instructor:
        return sign_in_page(request, pages, who)
    quizzes = [one for one in pages.library_for(who).quizzes.values() if one.questions]
    if not quizzes:
        return page(request, "gradebook.html", who=who, quizzes=[])
    chosen = pages.library_for(who).quiz(quiz) if quiz else quizzes[0]
    shown = {"find": find.replace("\0", ""), "show": show if show in SHOWS else SHOWS[0]}
    order = {"by": by if by in ORDERS else ORDERS[0], "descending": down}
    rows = rows_of(pages, who, chosen, start, **shown, **order)
    context: dict[str, Any] = {
        **shown,
        **order,
        "quizzes": quizzes,
        "quiz": chosen,
        "titles": [title_of(one) for one in chosen.questions],
        "of": sum(one.points for one in chosen.questions),
        "rows": rows[:ROWS],
        "following": start + ROWS if len(rows) > ROWS else None,
        "shows": SHOWN,
        "forms": FORMS,
    }
    return page(request, "gradebook.html", who=who, **context)


def rows_of(pages: PageContext, who: Identity, quiz: Quiz, start: int, **wanted: Any) -> list[dict[str, Any]]:
    """One learner more than a page has, each with a cell for every question."""
    with pages.database.read() as session:
        without, unseen = results.instructors(session, who.course), unseen_by(session, who).results
        ranking = Ranking(who.course, quiz.id, len(quiz.questions), without, reviewer=who.id, **wanted)
        found = results.ranked(session, ranking, start, ROWS + 1)
        counts = results.of_learners(session, who.course, quiz.id, [one.learner for one in found])
    return [
        {
            "standing": one,
            "cells": [cell_of(counts.get((one.learner, question.id)), unseen) for question in quiz.questions],
        }
        for one in found
    ]


def cell_of(result: Result | None, unseen: Collection[LearnerAt]) -> tuple[Told, Result | None]:
    """A result in words: what is not final waits, whatever its points are, and so does what is `unseen`."""
    if result is None:
        return NOT_ANSWERED, None
    if key_of(result) in unseen:
        return UNDECIDED, None
    if not result.is_final:
        return UNDECIDED, result
    if result.points >= result.max_points - POINTS_EQUAL:
        return STATUSES[Status.CORRECT], result
    return (PARTLY if result.points > 0 else STATUSES[Status.INCORRECT]), result


def key_of(result: Result) -> LearnerAt:
    """The learner and the question of a result."""
    return LearnerAt(result.course, result.learner, result.quiz, result.question)


def title_of(question: QuestionPart) -> str:
    """The title of a question, or its id."""
    return plain_text(question.title or question.label or question.id)


@router.get("/instructor/learners/{learner}")
def story(
    request: Request, learner: str, pages: Pages, who: Visitor, *, before: Annotated[str, Query(max_length=32)] = ""
) -> Response:
    """Every answer of a learner with its verdict, by question; of those under review without a name, how many.

    Raises Unauthorized, Forbidden, NotFound.
    """
    who = instructor(who)
    with pages.database.read() as session:
        wanted = SubmissionFilter(who.course, learner=learner)
        rows = submissions.page(session, wanted, before or None, ANSWERS + 1)
        member = people.get(session, learner, who.course)
        if member is None and not rows:
            raise NotFound("There is no such learner.")
        seen = blinded(pages.desk_of(who.course), session, who, rows, submissions.verdicts(session, rows))
        counts = results.everywhere(session, who.course, learner)
        unseen = unseen_by(session, who).results
        shown = [(row, given_in_full(row, seen.verdicts.get(row.id))) for row in rows[:ANSWERS]]
    given = [(row.quiz, row.question, None if row.id in seen.names else one) for row, one in shown]
    cells = {at: cell_of(result, unseen) for at, result in counts.items()}
    name = member.name if member is not None else rows[0].user
    parts = parts_of(pages.library_for(who), given, cells)
    following = rows[ANSWERS - 1].id if len(rows) > ANSWERS else None
    counted = [one for one in counts.values() if key_of(one) not in unseen]
    total = (sum(one.points for one in counted), sum(one.max_points for one in counted))
    return page(
        request, "learner.html", who=who, learner=learner, name=name, parts=parts, following=following,
        total=total, removed=member is None, lessons=lessons_of(pages.library_for(who).quizzes),
    )  # fmt: skip


def parts_of(
    library: Library,
    given: Sequence[tuple[str, str, Given | None]],
    cells: Mapping[tuple[str, str], tuple[Told, Result | None]],
) -> list[dict[str, Any]]:
    """The answers by question, in the order of the content; questions that it has lost come last.

    None stands for an answer that bears a pseudonym for its reviewers.
    """
    order = [(quiz.id, one.id) for quiz in library.quizzes.values() for one in quiz.questions]
    titles = {(quiz.id, one.id): title_of(one) for quiz in library.quizzes.values() for one in quiz.questions}
    places = {at: place for place, at in enumerate(order)}

    def place(one: tuple[str, str, Given | None]) -> tuple[int, str, str]:
        return places.get(one[:2], len(order)), one[0], one[1]

    return [
        {
            "quiz": at[1],
            "title": titles.get((at[1], at[2]), at[2]),
            "cell": cells.get((at[1], at[2]), (NOT_ANSWERED, None)),
            "answers": [answer for answer in answers if answer is not None],
            "blind": answers.count(None),
        }
        for at, theirs in groupby(sorted(given, key=place), key=place)
        for answers in [[answer for _, _, answer in theirs]]
    ]
