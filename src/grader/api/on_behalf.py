"""`/lms/submissions`: answers that another service hands in for learners whom it knows."""

from dataclasses import replace
from typing import Annotated, Any

from fastapi import APIRouter, Header, Request, Response
from starlette.routing import Route

from grader.api.admission import ON_BEHALF
from grader.api.context import AppContext, Service, service
from grader.api.intake import OnBehalfBody, answer_on_behalf
from grader.api.problems import documented
from grader.api.submissions import SubmissionView, answered, document
from grader.errors import NotFound
from grader.identity import Role
from grader.store import people, submissions

router = APIRouter()


async def hand_in_on_behalf(request: Request) -> Response:
    """Reads, stores and answers as `/submissions` does, for the learner whom the body names."""
    return await answered(request, ON_BEHALF, service, answer_on_behalf)


HAND_IN_ON_BEHALF = Route(ON_BEHALF, hand_in_on_behalf, methods=["POST"])
"""Served by the Shortcut, as HAND_IN is."""


@router.post(
    "/lms/submissions",
    status_code=201,
    response_model=SubmissionView,
    responses=documented(401, 403, 404, 409, 413, 422, 429, more={202: {"model": SubmissionView}}),
)
def create_submission_on_behalf(
    body: OnBehalfBody,
    idempotency_key: Annotated[str | None, Header(min_length=1, max_length=255)] = None,
) -> None:
    """Hands in an answer for a learner, who becomes a member at first sight: 201 with the verdict, else 202."""
    raise AssertionError("the Shortcut serves this")


@router.get(
    "/lms/submissions/{submission_id}",
    response_model=SubmissionView,
    responses=documented(401, 403, 404, 422, 429),
)
def show_submission_on_behalf(
    submission_id: str, who: Service, context: AppContext, response: Response
) -> dict[str, Any]:
    """Shows a submission of a learner whom another system knows, as that learner may see it now."""
    with context.database.read() as session:
        submission = submissions.get(session, submission_id) if submission_id.isalnum() else None
        if submission is None or submission.course != who.course:
            raise NotFound("There is no such submission.")
        member = people.get(session, submission.learner, who.course)
        if member is None or member.namespace is None:
            raise NotFound("There is no such submission.")
        theirs = replace(who, id=member.id, user=member.name, role=Role.STUDENT)
        return document(session, context, theirs, submission, response)
