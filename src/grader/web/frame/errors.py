"""Errors as pages: a browser that asked for a page gets one, where the API answers with a problem document."""

import json
from collections.abc import Mapping
from typing import Any

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from grader.web.frame.rendering import HEADERS, templates

PROBLEM = "application/problem+json"
NOT_PAGES = ("/api/", "/healthz", "/readyz", "/metrics", "/openapi.json", "/static/")

WORDS = {
    401: ("You are signed out", "Open your sign-in link again; what you handed in is kept."),
    403: ("This is not open to you", "Go back to the page you came from and try again from there."),
    404: ("There is nothing here", "The address may be mistyped, or the course has changed."),
    405: ("There is nothing here", "This address takes forms only."),
    409: ("Not now", "Reload the page to see what holds at present."),
    413: ("This is too long", "Shorten it and send it again; nothing was taken."),
    422: ("This could not be read", "Go back, mend it and send it again; nothing was taken."),
    429: ("Too many requests", "Wait a moment, then go back and try again; nothing was taken."),
    503: ("The service cannot answer now", "What you handed in is kept. Try again in a moment."),
}
OURS = ("Something went wrong on our side", "It is noted. What you handed in is kept; try again in a moment.")


class PageErrors:
    """ASGI middleware: renders problem documents for browsers that accept HTML, with the same status and headers."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serves the request."""
        if scope["type"] == "http" and wants_page(scope):
            send = ErrorPages(send).send
        await self.app(scope, receive, send)


def wants_page(scope: Scope) -> bool:
    """Says whether a browser opens a page: it accepts HTML, and the address is not one of programs."""
    path: str = scope["path"]
    return not path.startswith(NOT_PAGES) and "text/html" in Headers(scope=scope).get("accept", "")


class ErrorPages:
    """Sends one response; a problem document is held back until it is whole."""

    def __init__(self, send: Send) -> None:
        self._send = send
        self._start: Message | None = None
        self._body = b""

    async def send(self, message: Message) -> None:
        """Sends one part."""
        is_start = message["type"] == "http.response.start"
        if is_start and Headers(raw=message["headers"]).get("content-type", "").startswith(PROBLEM):
            self._start = message
        elif self._start is None:
            await self._send(message)
        else:
            self._body += message.get("body", b"")
            if not message.get("more_body", False):
                await self._send_page(self._start, render_error(self._start["status"], self._body))

    async def _send_page(self, start: Message, body: bytes) -> None:
        headers = MutableHeaders(scope=start)
        for name, value in HEADERS.items():
            headers[name] = value
        headers["Content-Type"] = "text/html; charset=utf-8"
        headers["Content-Length"] = str(len(body))
        headers["Cache-Control"] = "no-store"
        await self._send({**start, "headers": headers.raw})
        await self._send({"type": "http.response.body", "body": body})


def render_error(status: int, problem: bytes) -> bytes:
    """Returns the page of a problem."""
    told = parse_problem(problem)
    title, advice = WORDS.get(status, OURS)
    page = templates.get_template("error.html").render(
        who=None, status=status, title=title, advice=advice,
        detail=told.get("detail", ""), request_id=told.get("request_id", ""),
    )  # fmt: skip
    return page.encode()


def parse_problem(problem: bytes) -> Mapping[str, Any]:
    """Returns the members of a problem document."""
    try:
        found = json.loads(problem)
    except ValueError:
        return {}
    return found if isinstance(found, dict) else {}
