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
from grader.courses.blinding import unseen_by
from grader.courses.measuring import QuizStatistics, measured
from grader.courses.statistics import QuestionStatistics
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
        unseen = unseen_by(session, who).results
        etag = etag_of(who.course, library.digest(quiz_id), sorted(instructors), state, sorted(unseen))
        if unchanged(known, etag):
            return Response(status_code=304, headers={"ETag": etag})

        def measure() -> bytes:
            found = results.of_quiz(session, who.course, quiz_id)
            return written(quiz_id, measured(quiz, found, who.course, instructors, unseen))

        body = context.statistics.get(etag, measure)
    return Response(body, media_type="application/json", headers={"ETag": etag})


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
