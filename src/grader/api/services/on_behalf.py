"""`/lms`: answers that another service hands in for learners whom it knows, and the quizzes as these see them."""

from collections.abc import Callable, Coroutine
from dataclasses import replace
from typing import Any

from fastapi import APIRouter, Request, Response
from fastapi.concurrency import run_in_threadpool
from fastapi.exceptions import RequestValidationError
from pydantic import Field
from starlette.exceptions import HTTPException

from grader.api.bodies import RequestBody
from grader.api.learning.quizzes import view_quiz
from grader.api.learning.submissions import (
    SECURITY,
    AnswerBody,
    AnswerRoute,
    IdempotencyKey,
    SubmissionView,
    build_document,
    read_answer,
    respond_created,
)
from grader.api.views import QuizView
from grader.courses.answering.intake import NewAnswer
from grader.courses.people.external import External, check_external, find_learner
from grader.courses.people.identity import Identity, Role
from grader.errors import CallerError, NotFound
from grader.gate.admission import ON_BEHALF, PREFIX, get_identity
from grader.gate.callers import Service, api_router
from grader.gate.problems import refusals
from grader.gate.services import AppServices, Services, get_services
from grader.store import people, submissions
from grader.store.tables import EXTERNAL_ID, NAME, NAMESPACE

router = api_router("submissions")


class LearnerBody(RequestBody):
    """A learner as another system knows them. A `name` is what instructors see; without one they see the id."""

    namespace: str = Field(max_length=NAMESPACE)
    id: str = Field(max_length=EXTERNAL_ID)
    name: str | None = Field(default=None, max_length=NAME)


class LearnerOnlyBody(RequestBody):
    """Names a learner of another system."""

    learner: LearnerBody


class OnBehalfBody(AnswerBody):
    """An answer to one question by a learner of another system."""

    learner: LearnerBody


class OnBehalfRoute(AnswerRoute):
    """Its requests are counted here and not by admission: by learner, or as the service's if they name none."""

    roles = (Role.SERVICE,)

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """The handler of `AnswerRoute`, which counts a request whose body cannot be read."""
        handle = super().get_route_handler()

        async def handle_or_count(request: Request) -> Response:
            try:
                return await handle(request)
            except (RequestValidationError, HTTPException):
                get_services(request.app).admission.by_user.spend(get_identity(request.scope).id)
                raise

        return handle_or_count


answers = APIRouter(prefix=PREFIX, tags=["submissions"], route_class=OnBehalfRoute)


@answers.post(
    "/lms/submissions",
    status_code=201,
    response_model=SubmissionView,
    responses=refusals(401, 403, 404, 409, 413, 422, 429, more={202: {"model": SubmissionView}}),
    openapi_extra=SECURITY,
)
async def create_submission_on_behalf(
    request: Request, body: OnBehalfBody, idempotency_key: IdempotencyKey = None
) -> Response:
    """Hands in an answer for a learner, who becomes a member at first sight: 201 with the verdict, else 202."""
    services, who = get_services(request.app), get_identity(request.scope)
    try:
        learner = check_external(body.learner.namespace, body.learner.id)
    except CallerError:
        services.admission.by_user.spend(who.id)
        raise
    services.admission.by_user.spend((who.course, learner))
    answer = await run_in_threadpool(read_answer_of, services, who, learner, body, idempotency_key)
    return respond_created(ON_BEHALF, await services.writer.put(answer))


def read_answer_of(
    services: Services, who: Identity, learner: External, body: OnBehalfBody, key: str | None
) -> NewAnswer:
    """As `read_answer`, for a learner, who becomes a member only with an answer that can be read. Raises Forbidden for
    one who was removed."""
    if (body.quiz, body.question) in services.get_pipeline(who).drawn:  # the numbers are the member's
        member = find_learner(services.database, who, learner, body.learner.name)
        return read_answer(services, member, body, key)
    answer = read_answer(services, who, body, key)
    return replace(answer, who=find_learner(services.database, who, learner, body.learner.name))


@router.post("/lms/quizzes/{quiz_id}:show", response_model=QuizView, responses=refusals(401, 403, 404, 413, 422, 429))
def show_quiz_on_behalf(quiz_id: str, body: LearnerOnlyBody, who: Service, services: AppServices) -> dict[str, Any]:
    """Shows one quiz as a learner sees it, with their own drawn numbers and the attempts that they have used. They
    become a member at first sight. Raises Forbidden for one who was removed."""
    services.content.get(who.course).library.quiz(quiz_id)
    learner = check_external(body.learner.namespace, body.learner.id)
    return view_quiz(quiz_id, find_learner(services.database, who, learner, body.learner.name), services)


@router.get(
    "/lms/submissions/{submission_id}", response_model=SubmissionView, responses=refusals(401, 403, 404, 422, 429)
)
def show_submission_on_behalf(
    submission_id: str, who: Service, services: AppServices, response: Response
) -> dict[str, Any]:
    """Shows a submission of a learner whom another system knows, as that learner may see it now."""
    with services.database.read() as session:
        submission = submissions.get(session, submission_id) if submission_id.isalnum() else None
        if submission is None or submission.course != who.course:
            raise NotFound("There is no such submission.")
        member = people.get(session, submission.learner, who.course)
        if member is None or member.namespace is None:
            raise NotFound("There is no such submission.")
        theirs = replace(who, id=member.id, user=member.name, role=Role.STUDENT)
        return build_document(session, services, theirs, submission, response)
