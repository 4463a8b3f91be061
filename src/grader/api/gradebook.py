"""`/gradebook.csv`: the points that count, of every learner, for a spreadsheet or an LMS."""

import json
from collections.abc import Collection, Iterator, Sequence
from itertools import groupby
from typing import Annotated, Any

from fastapi import APIRouter, Query
from fastapi.responses import Response

from grader.api.conditional import etag_of, unchanged
from grader.api.context import AppContext, IfNoneMatch, Staff
from grader.api.problems import documented
from grader.courses.blinding import unseen_by
from grader.courses.gradebook import Column, Form, Row, gradebook_csv
from grader.domain.markup import plain_text
from grader.domain.quiz import Quiz
from grader.store import results
from grader.store.database import Database
from grader.store.results import LearnerAt

router = APIRouter()

NAMED = "name:"
CANVAS = "canvas"
"""The namespace of the ids that Canvas gives its users; ids of any other one are written as those of a school."""


@router.get(
    "/gradebook.csv",
    response_class=Response,
    responses=documented(
        401, 403, 404, 422, 429,
        more={200: {"content": {"text/csv": {"schema": {"type": "string"}}}}},
    ),
)  # fmt: skip
def gradebook(
    who: Staff,
    context: AppContext,
    quiz: Annotated[str | None, Query(max_length=64)] = None,
    form: Annotated[Form, Query(alias="format")] = Form.GENERIC,
    *,
    bom: bool = False,
    known: IfNoneMatch = "",
) -> Response:
    """Sends the gradebook of one quiz, or of all of them, as CSV: a row for each learner who has answered.

    An instructor who must not see a first mark yet gets an empty cell in its place.
    """
    library = context.content.of(who.course).library
    quizzes = list(library.quizzes.values()) if quiz is None else [library.quiz(quiz)]
    columns, ids = columns_of(quizzes), [one.id for one in quizzes]
    with context.database.read() as session:
        instructors = results.instructors(session, who.course)
        state = results.state(session, who.course, ids)
        unseen = unseen_by(session, who).results
    etag = etag_of(who.course, form, bom, columns, sorted(instructors), state, sorted(unseen))
    if unchanged(known, etag):
        return Response(status_code=304, headers={"ETag": etag})
    name = f"gradebook{'' if quiz is None else f'-{quiz}'}.csv"
    headers = {"ETag": etag, "Content-Disposition": f'attachment; filename="{name}"'}

    def written() -> bytes:
        rows = learners(context.database, who.course, ids, instructors, unseen)
        return "".join(gradebook_csv(rows, columns, form, bom=bom)).encode()

    return Response(context.gradebooks.get(etag, written), media_type="text/csv; charset=utf-8", headers=headers)


def columns_of(quizzes: Sequence[Quiz]) -> list[Column]:
    """A column for every question."""
    return [
        Column(quiz.id, question.id, plain_text(question.title or question.label or question.id), question.points)
        for quiz in quizzes
        for question in quiz.questions
    ]


def learners(
    database: Database, course: str, quizzes: list[str], instructors: set[str], unseen: Collection[LearnerAt]
) -> Iterator[Row]:
    """A row for each learner with results, ordered by name; instructors' own tries and `unseen` marks are left out."""
    with database.read() as session:
        found = results.points_by_learner(session, course, quizzes)
        for learner, several in groupby(found, key=lambda row: row.learner):
            theirs = list(several)
            points = {
                (row.quiz, name): points
                for row in theirs
                for name, points in json.loads(row.points).items()
                if not unseen or LearnerAt(course, learner, row.quiz, name) not in unseen
            }
            if learner not in instructors:
                yield row_of(theirs[0], points)


def row_of(known: Any, points: dict[tuple[str, str], float]) -> Row:
    """The row of a learner; `known` has the columns of `results.points_by_learner`."""
    is_named = known.account is not None and known.account.startswith(NAMED)
    is_canvas = known.namespace == CANVAS
    return Row(
        user=known.name,
        login=known.name if is_named else "",
        email=known.email or "",
        lms_id=known.external_id if is_canvas else "",
        sis_id="" if is_canvas else known.external_id or "",
        points=points,
    )
