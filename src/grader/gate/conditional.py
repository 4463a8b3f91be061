"""ETags of documents, and the requests that carry one."""

import hashlib

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

OF_THE_BODY = ("Content-Length", "Content-Type", "Content-Disposition")
"""Headers that a 304 does not have."""


def compute_etag(*parts: object) -> str:
    """An ETag that is the same while the parts are; their `repr` is hashed."""
    return f'"{hashlib.sha256(repr(parts).encode()).hexdigest()[:24]}"'


def is_unchanged(if_none_match: str, etag: str) -> bool:
    """Whether an `If-None-Match` header names this ETag, so that the answer is 304."""
    return if_none_match.strip() == "*" or etag in [tag.strip().removeprefix("W/") for tag in if_none_match.split(",")]


class ConditionalMiddleware:
    """ASGI middleware for GET. Gives answers an ETag, and answers 304 to a request that names it in If-None-Match. A
    route may set an ETag itself; otherwise it is a digest of the body. Streams without one, and what must not be
    stored, are left as they are."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serves the request."""
        sender = ConditionalSender(Headers(scope=scope).get("if-none-match", ""), send)
        await self.app(scope, receive, sender.send)


class ConditionalSender:
    """Sends one response. Its start is held back until the first part of its body is there."""

    def __init__(self, known: str, send: Send) -> None:
        self._known, self._send = known, send
        self._start: Message | None = None
        self._is_unchanged = False

    async def send(self, message: Message) -> None:
        """Sends one part."""
        if message["type"] == "http.response.start" and can_be_tagged(message):
            self._start = message
            return
        if self._start is not None:
            await self._send_start(self._start, message)
            self._start = None
        if not self._is_unchanged:
            await self._send(message)

    async def _send_start(self, start: Message, first: Message) -> None:
        headers = MutableHeaders(scope=start)
        if "etag" not in headers and not first.get("more_body", False):
            headers["ETag"] = compute_etag(first.get("body", b""))
        self._is_unchanged = is_unchanged(self._known, headers.get("etag", "-"))
        if not self._is_unchanged:
            await self._send(start)
            return
        for name in OF_THE_BODY:
            del headers[name]
        await self._send({**start, "status": 304})
        await self._send({"type": "http.response.body"})


def can_be_tagged(start: Message) -> bool:
    """Whether a response that starts like this is a document that may come again."""
    headers = Headers(raw=start["headers"])
    is_stream = headers.get("content-type", "").startswith("text/event-stream")
    return start["status"] == 200 and not is_stream and "no-store" not in headers.get("cache-control", "")
