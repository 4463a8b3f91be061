"""`/quizzes/{quiz}/statistics`: difficulty, discrimination, wrong answers and named mistakes, for instructors."""

import json
from dataclasses import asdict
from typing import Any

from fastapi.responses import Response

from grader.api.views import StatisticsView
from grader.courses.reporting.quiz_statistics import QuizStatistics
from grader.courses.rules.statistics import QuestionStatistics
from grader.gate.callers import IfNoneMatch, Instructor, api_router
from grader.gate.conditional import compute_etag, is_unchanged
from grader.gate.problems import refusals
from grader.gate.services import AppServices

router = api_router("results")


@router.get(
    "/quizzes/{quiz_id}/statistics", responses=refusals(401, 403, 404, 422, 429, more={200: {"model": StatisticsView}})
)
def show_statistics(quiz_id: str, who: Instructor, services: AppServices, known: IfNoneMatch = "") -> Response:
    """Tells how hard each question is, how well it discriminates, and what goes wrong, with numbers of learners."""
    version = services.statistics.version(services.content.get(who.course).library, quiz_id, who)
    etag = compute_etag(version.parts)
    if is_unchanged(known, etag):
        return Response(status_code=304, headers={"ETag": etag})
    body = describe_statistics(quiz_id, services.statistics.compute(version))
    return Response(body, media_type="application/json", headers={"ETag": etag})


def describe_statistics(quiz: str, statistics: QuizStatistics) -> bytes:
    """The statistics of a quiz as JSON."""
    questions = [build_item(question) for question in statistics.questions]
    return json.dumps({"quiz": quiz, "learners": statistics.learners, "questions": questions}).encode()


def build_item(question: QuestionStatistics) -> dict[str, Any]:
    """The statistics of one question as plain JSON; counts as lists, the largest mistake first."""
    return asdict(question) | {
        "options": [{"option": option, "learners": n} for option, n in question.options.items()],
        "mistakes": [{"diagnosis": diagnosis, "learners": n} for diagnosis, n in question.mistakes.items()],
    }
