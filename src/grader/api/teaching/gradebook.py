"""`/gradebook.csv`: the points that count, of every learner, for a spreadsheet or an LMS."""

import json
import math
from collections import defaultdict
from collections.abc import Collection, Mapping, Sequence
from functools import lru_cache
from itertools import groupby
from operator import attrgetter, itemgetter
from typing import Annotated, Any

from fastapi import Query
from fastapi.responses import Response
from sqlalchemy.orm import Session

from grader.courses.people.namesakes import make_marks
from grader.courses.reviewing.blinding import find_unseen
from grader.courses.rules.gradebook import Column, Form, LearnerRow, Unit, gradebook_csv
from grader.domain.pages.markup import plain_text
from grader.gate.callers import IfNoneMatch, Staff, api_router
from grader.gate.conditional import compute_etag, is_unchanged
from grader.gate.problems import refusals
from grader.gate.services import AppServices
from grader.questions import Question, Quiz
from grader.store import people, results
from grader.store.results import LearnerAt

router = api_router("results")

NAMED = "name:"
CANVAS = "canvas"
"""The namespace of the ids that Canvas gives its users; ids of any other one are written as those of a school."""


@router.get(
    "/gradebook.csv",
    response_class=Response,
    responses=refusals(
        401, 403, 404, 422, 429,
        more={200: {"content": {"text/csv": {"schema": {"type": "string"}}}}},
    ),
)  # fmt: skip
def export_gradebook(
    who: Staff,
    services: AppServices,
    quiz: Annotated[str | None, Query(max_length=64)] = None,
    form: Annotated[Form, Query(alias="format")] = Form.GENERIC,
    *,
    by: Unit = Unit.QUESTION,
    bom: bool = False,
    known: IfNoneMatch = "",
) -> Response:
    """Sends the gradebook of one quiz, or of all of them, as CSV: a row for each learner who has answered.

    Then one without points for each who has not begun, if more than a browser session knows them. In the generic form
    `user` is the learner's name, which several may bear, and `id` tells them apart; for Canvas a mark follows the name.
    Who was removed from the course is left out for Canvas and Moodle, which may not know them any more. An instructor
    who must not see a first mark yet gets an empty cell in its place, and in that of sums. With `by=quiz` a column has
    the sum of a quiz.
    """
    library = services.content.get(who.course).library
    quizzes = list(library.quizzes.values()) if quiz is None else [library.quiz(quiz)]
    columns = list_columns(quizzes) if by is Unit.QUESTION else quiz_columns(quizzes)
    ids = [quiz.id for quiz in quizzes]
    with services.database.read() as session:
        without = results.list_instructors(session, who.course)
        if form is not Form.GENERIC:
            without |= people.list_removed(session, who.course)
        state = results.read_state(session, who.course, ids)
        unseen = find_unseen(session, who).results
        marks = make_marks(session, who.course) if form is Form.CANVAS else {}
        absent = [
            build_row(member.id, member, {}, marks) for member in people.list_without_results(session, who.course, ids)
        ]
        known_now = sorted(without), state, sorted(unseen), absent, sorted(marks)
        etag = compute_etag(who.course, form, bom, columns, known_now)
        if is_unchanged(known, etag):
            return Response(status_code=304, headers={"ETag": etag})
        present = read_rows(session, who.course, ids, without, unseen, marks=marks)
        if by is Unit.QUIZ:
            present = [sum_up(row, quizzes) for row in present]
        body = "".join(gradebook_csv([*present, *absent], columns, form, bom=bom)).encode()
    name = f"gradebook{'' if quiz is None else f'-{quiz}'}.csv"
    headers = {"ETag": etag, "Content-Disposition": f'attachment; filename="{name}"'}
    return Response(body, media_type="text/csv; charset=utf-8", headers=headers)


def list_columns(quizzes: Sequence[Quiz]) -> list[Column]:
    """A column for every question."""
    return [
        Column(quiz.id, question.id, write_title(quiz, question), question.points)
        for quiz in quizzes
        for question in quiz.questions
    ]


def quiz_columns(quizzes: Sequence[Quiz]) -> list[Column]:
    """A column for every quiz that has questions."""
    return [
        Column(quiz.id, "", plain_text(quiz.title), math.fsum(question.points for question in quiz.questions))
        for quiz in quizzes
        if quiz.questions
    ]


def sum_up(row: LearnerRow, quizzes: Sequence[Quiz]) -> LearnerRow:
    """The row with a sum for each quiz; none where no question of it has points yet, or one that is hidden."""
    sums = {}
    for quiz in quizzes:
        if quiz.id in row.hidden:
            continue
        known = [row.points.get((quiz.id, question.id)) for question in quiz.questions]
        if any(points is not None for points in known):
            sums[quiz.id, ""] = math.fsum(filter(None, known))
    return row._replace(points=sums)


def write_title(quiz: Quiz, question: Question) -> str:
    """What an LMS calls the assignment of a question: its own title, else that of the quiz and its id."""
    own = question.title or question.label
    return plain_text(own) if own else f"{plain_text(quiz.title)}: {question.id}"


def read_rows(
    session: Session, course: str, quizzes: Sequence[str], without: Collection[str], unseen: Collection[LearnerAt],
    *, marks: Mapping[str, str],
) -> list[LearnerRow]:  # fmt: skip
    """Reads the row of each learner with results, by name, but of those `without` a row, and without `unseen` marks."""
    hidden: dict[str, set[tuple[str, str]]] = defaultdict(set)
    for place in (place for place in unseen if place.quiz in quizzes):
        hidden[place.learner].add((place.quiz, place.question))
    rows = []
    for learner, group in groupby(results.points_by_learner(session, course, quizzes), key=itemgetter(0)):
        if learner in without:
            continue
        first, *others = group
        points = points_of(first[1], first[2])
        if others or learner in hidden:
            each = [points, *(points_of(row[1], row[2]) for row in others)]
            points = {
                place: value for of in each for place, value in of.items() if place not in hidden.get(learner, ())
            }
        row = build_row(learner, first, points, marks)
        rows.append(row._replace(hidden=frozenset(quiz for quiz, _ in hidden[learner])) if learner in hidden else row)
    return sorted(rows, key=attrgetter("user", "id"))


@lru_cache(maxsize=4096)
def points_of(quiz: str, points: str) -> Mapping[tuple[str, str], float]:
    """Points by (quiz, question) from those by question as JSON text. Learners with equal points share it."""
    return {(quiz, question): value for question, value in json.loads(points).items()}


def build_row(
    learner: str, known: Any, points: Mapping[tuple[str, str], float], marks: Mapping[str, str]
) -> LearnerRow:
    """The row of the learner with this id; `known` has the name and the columns `results.KNOWN` of a member. `marks`
    has those of learners whose name another bears too."""
    is_named = known.account is not None and known.account.startswith(NAMED)
    login = known.account.removeprefix(NAMED) if is_named else ""
    is_canvas = known.namespace == CANVAS
    return LearnerRow(
        user=known.name, login=login, id=learner, email=known.email or "",
        lms_id=known.external_id if is_canvas else "", sis_id="" if is_canvas else known.external_id or "",
        points=points, mark=marks.get(learner, "")
    )  # fmt: skip
