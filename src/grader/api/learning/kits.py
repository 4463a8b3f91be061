"""`/quizzes/{quiz}/questions/{question}/kit`: what a learner needs on a machine of her own."""

from typing import Any

from fastapi import Request
from fastapi.responses import Response

from grader.gate.callers import Anybody, api_router
from grader.gate.problems import refusals
from grader.gate.services import AppServices
from grader.pack.kit import build_kit

router = api_router("quizzes")

ZIP = "application/zip"
FILE: dict[str, Any] = {"content": {ZIP: {"schema": {"type": "string", "format": "binary"}}}}


@router.get(
    "/quizzes/{quiz_id}/questions/{question_id}/kit",
    response_class=Response,
    responses=refusals(401, 404, 409, 422, 429, more={200: FILE}),
)
def download_kit(quiz_id: str, question_id: str, who: Anybody, services: AppServices, request: Request) -> Response:
    """Sends the kit of an exercise as a zip file: starter, models, visible cases, how they are judged, a notebook.

    Nothing hidden is in it. The same content gives the same bytes at the same address. Before the quiz opens the
    answer is 409.
    """
    library = services.content.get(who.course).library
    policy = services.require_opened(library, who, quiz_id)
    kit = build_kit(
        library, quiz_id, question_id, judged=policy.shows_feedback_at_once, origin=services.origin_of(request)
    )
    headers = {"Content-Disposition": f'attachment; filename="{question_id}.zip"'}
    return Response(kit, headers=headers, media_type=ZIP)
