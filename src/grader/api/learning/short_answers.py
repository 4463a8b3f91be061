"""Short answers, which most requests hand in, taken past FastAPI: to look through routes, solve dependencies and wrap
handlers takes it longer than all that we do for an answer. Only what is taken is answered here. Whatever is refused, or
is not plainly a short answer, goes the long way, to the route of the same path: it alone says why, and is described in
OpenAPI."""

from fastapi import Response
from pydantic import ValidationError
from starlette.datastructures import Headers
from starlette.requests import ClientDisconnect
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from grader.api.learning.submissions import KEY_MAX, AnswerFields, AnswerRoute, answers, read_answer, respond_created
from grader.courses.people.identity import Identity
from grader.errors import CallerError
from grader.gate.admission import SUBMISSIONS
from grader.gate.services import Services

BYTES_MAX = 1000
"""Longest body that is taken here. It is read and graded in the event loop: a change of threads takes as long."""

(ROUTE,) = answers.routes
"""The long way, under whose path requests are counted and logged."""


class ShortAnswersMiddleware:
    """ASGI middleware behind admission: takes `POST /api/v1/submissions` with a short body of JSON."""

    def __init__(self, app: ASGIApp, services: Services) -> None:
        self.app, self.services = app, services

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Takes the answer, or hands the request on."""
        if scope.get("path") != SUBMISSIONS or scope["method"] != "POST":
            await self.app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        key = headers.get("idempotency-key")
        if not has_short_json(headers) or (key is not None and not 0 < len(key) <= KEY_MAX):
            await self.app(scope, receive, send)
            return
        scope["route"] = ROUTE
        text = await read_body(receive)
        try:
            response = await take_answer(self.services, scope["state"]["identity"], text, key)
        except (CallerError, ValidationError):  # nothing was stored
            await self.app(scope, replay(text, receive), send)
            return
        await response(scope, receive, send)


def has_short_json(headers: Headers) -> bool:
    """Whether a body is announced as short and as JSON."""
    announced = headers.get("content-length", "")
    is_json = headers.get("content-type", "").partition(";")[0].strip() == "application/json"
    return is_json and announced.isdecimal() and int(announced) <= BYTES_MAX and "transfer-encoding" not in headers


async def read_body(receive: Receive) -> bytes:
    """Reads the body of a request. Raises ClientDisconnect."""
    parts: list[bytes] = []
    while True:
        message = await receive()
        if message["type"] == "http.disconnect":
            raise ClientDisconnect
        parts.append(message.get("body", b""))
        if not message.get("more_body", False):
            return b"".join(parts)


def replay(text: bytes, receive: Receive) -> Receive:
    """A `receive` that begins with the body that was read."""
    messages: list[Message] = [{"type": "http.request", "body": text, "more_body": False}]

    async def receive_again() -> Message:
        return messages.pop() if messages else await receive()

    return receive_again


async def take_answer(services: Services, who: Identity, text: bytes, key: str | None) -> Response:
    """Hands in an answer, as the route `create_submission` does. Raises CallerError, and ValidationError for another
    body."""
    who.require(*AnswerRoute.roles)
    body = AnswerFields.model_validate_json(text)
    answer = read_answer(services, who, body, key, is_short=True)
    return respond_created(SUBMISSIONS, await services.writer.put(answer))
