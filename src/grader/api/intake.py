"""Reading an answer that is handed in, and grading it where that is instant, for the route that must be fast.

FastAPI documents the route by its signature, but does not call it: here a body is validated once, and the response is
serialised once, without a change of threads where the answer is short.
"""

from dataclasses import replace
from typing import Any, TypeVar

from fastapi.concurrency import run_in_threadpool
from fastapi.exceptions import RequestValidationError
from pydantic import BaseModel, ConfigDict, Field, ValidationError
from starlette.requests import Request

from grader.api.context import Context
from grader.courses.external import checked, learner_behind
from grader.courses.handing_in import Answer
from grader.errors import CallerError
from grader.identity import Identity
from grader.store.tables import EXTERNAL_ID, NAME, NAMESPACE

SHORT_BYTES = 4096
"""Bodies up to here are read and graded in the event loop, in some tenths of a millisecond."""
KEY_CHARACTERS_MAX = 255


class AnswerBody(BaseModel):
    """An answer to one question: an option index, a number or text, or {"source": "..."}."""

    model_config = ConfigDict(extra="forbid")

    quiz: str = Field(max_length=64)
    question: str = Field(max_length=64)
    answer: Any


class LearnerBody(BaseModel):
    """A learner as another system knows them. A `name` is what instructors see; without one they see the id."""

    model_config = ConfigDict(extra="forbid")

    namespace: str = Field(max_length=NAMESPACE)
    id: str = Field(max_length=EXTERNAL_ID)
    name: str | None = Field(default=None, max_length=NAME)


class OnBehalfBody(AnswerBody):
    """An answer to one question by a learner of another system."""

    learner: LearnerBody


Body = TypeVar("Body", bound=AnswerBody)


async def own_answer(context: Context, who: Identity, raw: bytes, key: str | None) -> Answer:
    """The answer in the body of a request; the same idempotency `key` makes it the same submission.

    Raises NotFound, TooLarge, Unprocessable, RequestValidationError.
    """

    def read_own() -> Answer:
        return read(context, who, parsed(AnswerBody, raw), key)

    return read_own() if len(raw) <= SHORT_BYTES else await run_in_threadpool(read_own)


async def answer_on_behalf(context: Context, service: Identity, raw: bytes, key: str | None) -> Answer:
    """As `own_answer`, for the learner whom the body names. The request counts as theirs; the service's without a name.

    A learner becomes a member only with an answer that can be read. Raises Forbidden for one who was removed, and
    TooManyRequests.
    """
    try:
        body = await run_in_threadpool(parsed, OnBehalfBody, raw)
        learner = checked(body.learner.namespace, body.learner.id)
    except (RequestValidationError, CallerError):
        context.by_user.spend(service.id)
        raise
    context.by_user.spend((service.course, learner))

    def read_theirs() -> Answer:
        answer = read(context, service, body, key)
        return replace(answer, who=learner_behind(context.database, service, learner, body.learner.name))

    return await run_in_threadpool(read_theirs)


def parsed(shape: type[Body], raw: bytes) -> Body:
    """The body of a request. Raises RequestValidationError."""
    try:
        return shape.model_validate_json(raw)
    except ValidationError as error:
        raise RequestValidationError([{**one, "loc": ("body", *one["loc"])} for one in error.errors()]) from error


def read(context: Context, who: Identity, body: AnswerBody, key: str | None) -> Answer:
    """Reads an answer, and grades it where that is instant. Raises NotFound, TooLarge, Unprocessable."""
    pipeline = context.content.of(who.course).pipeline
    submission = pipeline.read(body.quiz, body.question, body.answer)
    verdict = pipeline.judge(submission) if submission.is_instant else None
    return Answer(who, pipeline.library, submission, verdict, key, context.queue_per_user)


def key_of(request: Request) -> str | None:
    """The idempotency key of a request. Raises RequestValidationError."""
    key = request.headers.get("idempotency-key")
    if key is not None and not 1 <= len(key) <= KEY_CHARACTERS_MAX:
        why = f"String should have 1 to {KEY_CHARACTERS_MAX} characters"
        raise RequestValidationError([{"loc": ("header", "idempotency-key"), "msg": why}])
    return key


def is_json(request: Request) -> bool:
    """Whether the body claims to be JSON: a browser cannot send that from another site without asking first."""
    media_type = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    return media_type == "application/json" or (media_type.startswith("application/") and media_type.endswith("+json"))
