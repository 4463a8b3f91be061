"""`/quizzes/{quiz}/statistics`: difficulty, discrimination, wrong answers and named mistakes, for instructors."""

import json
from dataclasses import asdict
from functools import lru_cache
from typing import Any

from fastapi import APIRouter
from fastapi.responses import Response

from grader.api.conditional import etag_of, unchanged
from grader.api.context import AppContext, IfNoneMatch, Instructor
from grader.api.problems import documented
from grader.api.views import StatisticsView
from grader.courses.statistics import QuestionStatistics, Row, statistics_of
from grader.domain.quiz import NumericQuestion, Quiz
from grader.domain.verdict import Status
from grader.store import results

router = APIRouter()


@router.get(
    "/quizzes/{quiz_id}/statistics",
    responses=documented(401, 403, 404, 422, 429, more={200: {"model": StatisticsView}}),
)
def show_statistics(quiz_id: str, who: Instructor, context: AppContext, known: IfNoneMatch = "") -> Response:
    """Tells how hard each question is, how well it discriminates, and what goes wrong, with numbers of learners."""
    library = context.content.of(who.course).library
    quiz = library.quiz(quiz_id)
    with context.database.read() as session:
        instructors = results.instructors(session, who.course)
        state = results.state(session, who.course, [quiz_id])
        etag = etag_of(who.course, library.digest(quiz_id), sorted(instructors), state)
        if unchanged(known, etag):
            return Response(status_code=304, headers={"ETag": etag})

        def measure() -> bytes:
            return measured(quiz, results.of_quiz(session, who.course, quiz_id), instructors)

        body = context.statistics.get(etag, measure)
    return Response(body, media_type="application/json", headers={"ETag": etag})


def measured(quiz: Quiz, found: Any, instructors: set[str]) -> bytes:
    """The statistics of a quiz as JSON; instructors' own tries are left out."""
    questions = {question.id: question for question in quiz.questions}
    tolerances = {one.id: one.tolerance for one in quiz.questions if isinstance(one, NumericQuestion)}
    rows = [row_of(row) for row in found if row.learner not in instructors and row.question in questions]
    by_question = {one.question: one for one in statistics_of(rows, tolerances)}
    items = [item(by_question[name]) for name in questions if name in by_question]
    learners = len({row.learner for row in rows})
    return json.dumps({"quiz": quiz.id, "learners": learners, "questions": items}).encode()


def row_of(row: Any) -> Row:
    """A stored result as statistics read it."""
    return Row(
        row.learner,
        row.question,
        row.points,
        row.max_points,
        Status(row.first_status),
        row.first_option,
        row.first_value,
        diagnoses_of(row.diagnoses),
    )


@lru_cache(maxsize=4096)
def diagnoses_of(text: str) -> tuple[str, ...]:
    """The diagnoses that a result lists. Learners share them."""
    return tuple(json.loads(text))


def item(one: QuestionStatistics) -> dict[str, Any]:
    """The statistics of one question as plain JSON; counts as lists, the largest mistake first."""
    return asdict(one) | {
        "options": [{"option": option, "learners": n} for option, n in one.options.items()],
        "mistakes": [{"diagnosis": diagnosis, "learners": n} for diagnosis, n in one.mistakes.items()],
    }
