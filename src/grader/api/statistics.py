"""`/quizzes/{quiz}/statistics`: difficulty, discrimination, wrong answers and named mistakes, for instructors."""

import json
from dataclasses import asdict
from typing import Any

from fastapi import APIRouter
from fastapi.responses import Response

from grader.api.conditional import etag_of, unchanged
from grader.api.context import AppContext, IfNoneMatch, Instructor
from grader.api.problems import documented
from grader.api.views import StatisticsView
from grader.courses.measuring import QuizStatistics
from grader.courses.statistics import QuestionStatistics

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
        version = context.statistics.version(session, library, quiz_id, who)
        etag = etag_of(version.parts)
        if unchanged(known, etag):
            return Response(status_code=304, headers={"ETag": etag})
        found = context.statistics.of(session, quiz, version)
    return Response(written(quiz_id, found), media_type="application/json", headers={"ETag": etag})


def written(quiz: str, statistics: QuizStatistics) -> bytes:
    """The statistics of a quiz as JSON."""
    questions = [item(one) for one in statistics.questions]
    return json.dumps({"quiz": quiz, "learners": statistics.learners, "questions": questions}).encode()


def item(one: QuestionStatistics) -> dict[str, Any]:
    """The statistics of one question as plain JSON; counts as lists, the largest mistake first."""
    return asdict(one) | {
        "options": [{"option": option, "learners": n} for option, n in one.options.items()],
        "mistakes": [{"diagnosis": diagnosis, "learners": n} for diagnosis, n in one.mistakes.items()],
    }
