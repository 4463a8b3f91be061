"""`/gradebook.csv`: the points that count, of every learner, for a spreadsheet or an LMS."""

import json
from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping, Sequence, Set
from functools import lru_cache
from itertools import chain, groupby
from operator import itemgetter
from typing import Annotated, Any

from fastapi import APIRouter, Query
from fastapi.responses import Response
from sqlalchemy.orm import Session

from grader.api.conditional import etag_of, unchanged
from grader.api.context import AppContext, IfNoneMatch, Staff
from grader.api.problems import documented
from grader.courses.blinding import unseen_by
from grader.courses.gradebook import Column, Form, Row, Sheet, SheetLines, gradebook_csv, row_lines
from grader.courses.namesakes import marks_in
from grader.domain.markup import plain_text
from grader.domain.quiz import Question, Quiz
from grader.store import people, results
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

    Then one without points for each who has not begun, if more than a browser session knows them. In the generic form
    `user` is the learner's name, which several may bear, and `id` tells them apart; for Canvas a mark follows the name.
    An instructor who must not see a first mark yet gets an empty cell in its place.
    """
    library = context.content.of(who.course).library
    quizzes = list(library.quizzes.values()) if quiz is None else [library.quiz(quiz)]
    columns, ids = columns_of(quizzes), [one.id for one in quizzes]
    with context.database.read() as session:
        instructors = results.instructors(session, who.course)
        state = results.state(session, who.course, ids)
        unseen = unseen_by(session, who).results
        marks = marks_in(session, who.course) if form is Form.CANVAS else {}
        absent = [row_of(one.id, one, {}, marks) for one in people.without_results(session, who.course, ids)]
        known_now = sorted(instructors), state, sorted(unseen), absent, sorted(marks)
        etag = etag_of(who.course, form, bom, columns, known_now)
        if unchanged(known, etag):
            return Response(status_code=304, headers={"ETag": etag})

        def written() -> bytes:
            sheet = Sheet(who.course, tuple(columns), form)
            learners = lines_by_name(session, context.gradebook_lines, sheet, instructors, unseen, marks=marks)
            lines = chain(gradebook_csv((), columns, form, bom=bom), learners, row_lines(absent, columns, form))
            return "".join(lines).encode()

        body = context.gradebooks.get(etag, written)
    name = f"gradebook{'' if quiz is None else f'-{quiz}'}.csv"
    headers = {"ETag": etag, "Content-Disposition": f'attachment; filename="{name}"'}
    return Response(body, media_type="text/csv; charset=utf-8", headers=headers)


def columns_of(quizzes: Sequence[Quiz]) -> list[Column]:
    """A column for every question."""
    return [
        Column(quiz.id, question.id, title_of(quiz, question), question.points)
        for quiz in quizzes
        for question in quiz.questions
    ]


def title_of(quiz: Quiz, question: Question) -> str:
    """What an LMS calls the assignment of a question: its own title, else that of the quiz and its id."""
    own = question.title or question.label
    return plain_text(own) if own else f"{plain_text(quiz.title)}: {question.id}"


def lines_by_name(
    session: Session, kept: SheetLines, sheet: Sheet, instructors: Collection[str], unseen: Collection[LearnerAt], *,
    marks: Mapping[str, str],
) -> Iterator[str]:  # fmt: skip
    """The line of each learner with results, ordered by name; instructors' own tries and `unseen` marks are left out.

    After a change, only the lines of the learners whose results have changed are read again.
    """
    quizzes = list(dict.fromkeys(column.quiz for column in sheet.columns))
    hidden: dict[str, set[LearnerAt]] = defaultdict(set)
    for one in unseen:
        hidden[one.learner].add(one)
    states = {
        learner: (state, learner in marks, frozenset(hidden.get(learner, ())))
        for learner, state in results.states_of_learners(session, sheet.course, quizzes).items()
        if learner not in instructors
    }

    def read(changed: Set[str]) -> dict[str, tuple[str, str]]:
        rows = dict(rows_of(session, sheet.course, quizzes, changed, hidden, marks=marks))
        lines = row_lines(rows.values(), sheet.columns, sheet.form)
        return {learner: (row.user, line) for (learner, row), line in zip(rows.items(), lines, strict=True)}

    named = sorted((name, learner, line) for learner, (name, line) in kept.get(sheet, states, read).items())
    return (line for _, _, line in named)


def rows_of(
    session: Session, course: str, quizzes: Sequence[str], learners: Set[str], hidden: Mapping[str, Set[LearnerAt]], *,
    marks: Mapping[str, str],
) -> Iterator[tuple[str, Row]]:  # fmt: skip
    """Each of these learners with their row."""
    found = results.points_by_learner(session, course, quizzes, learners)
    for learner, several in groupby(found, key=itemgetter(0)):
        theirs = list(several)
        points = {place: one for row in theirs for place, one in points_of(row.quiz, row.points).items()}
        if learner in hidden:
            points = {at: one for at, one in points.items() if LearnerAt(course, learner, *at) not in hidden[learner]}
        yield learner, row_of(learner, theirs[0], points, marks)


@lru_cache(maxsize=4096)
def points_of(quiz: str, points: str) -> Mapping[tuple[str, str], float]:
    """Points by (quiz, question) from those by question as JSON text. Learners with equal points share it."""
    return {(quiz, question): one for question, one in json.loads(points).items()}


def row_of(learner: str, known: Any, points: Mapping[tuple[str, str], float], marks: Mapping[str, str]) -> Row:
    """The row of the learner with this id; `known` has the name and the columns `results.KNOWN` of a member.

    `marks` has those of learners whose name another bears too.
    """
    is_named = known.account is not None and known.account.startswith(NAMED)
    is_canvas = known.namespace == CANVAS
    return Row(
        user=known.name,
        login=known.name if is_named else "",
        id=learner,
        email=known.email or "",
        lms_id=known.external_id if is_canvas else "",
        sis_id="" if is_canvas else known.external_id or "",
        points=points,
        mark=marks.get(learner, ""),
    )
