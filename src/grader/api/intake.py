"""Handing in an answer: read and graded or queued, and stored by the writer. It serves the route that must be fast.

FastAPI documents the route by its signature, but does not call it: here a body is validated once, and the response is
serialised once, without a change of threads where the answer is short.
"""

from typing import Any

from fastapi.concurrency import run_in_threadpool
from fastapi.exceptions import RequestValidationError
from pydantic import BaseModel, ConfigDict, Field, ValidationError
from starlette.requests import Request

from grader.api.context import Context
from grader.courses.handing_in import Answer, Receipt
from grader.errors import CallerError
from grader.identity import Identity

SHORT_BYTES = 4096
"""Bodies up to here are read and graded in the event loop, in some tenths of a millisecond."""
KEY_CHARACTERS_MAX = 255


class AnswerBody(BaseModel):
    """An answer to one question: an option index, a number or text, or {"source": "..."}."""

    model_config = ConfigDict(extra="forbid")

    quiz: str = Field(max_length=64)
    question: str = Field(max_length=64)
    answer: Any


async def accept(context: Context, who: Identity, raw: bytes, key: str | None) -> Receipt:
    """Stores an answer, with its verdict where that is instant, else with a job for a worker.

    The same idempotency `key` with the same answer gives the first receipt again.
    Raises Unauthorized, NotFound, Conflict, TooLarge, Unprocessable, TooManyRequests, RequestValidationError.
    """
    if len(raw) > SHORT_BYTES:
        answer = await run_in_threadpool(read, context, who, raw, key)
    else:
        answer = read(context, who, raw, key)
    await context.writer.put(answer)
    if isinstance(answer.outcome, CallerError):
        raise answer.outcome
    assert answer.outcome is not None
    return answer.outcome


def read(context: Context, who: Identity, raw: bytes, key: str | None) -> Answer:
    """Reads an answer, and grades it where that is instant."""
    try:
        body = AnswerBody.model_validate_json(raw)
    except ValidationError as error:
        raise RequestValidationError([{**one, "loc": ("body", *one["loc"])} for one in error.errors()]) from error
    pipeline = context.content.of(who.course).pipeline
    parsed = pipeline.read(body.quiz, body.question, body.answer)
    verdict = pipeline.judge(parsed) if parsed.is_instant else None
    return Answer(who, pipeline.library, parsed, verdict, key, context.queue_per_user)


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
