"""Gives every request an id, an answer whatever happens, one line in the log and its place in the metrics."""

import re
import time
from functools import cache
from random import getrandbits
from typing import Any

import structlog
from prometheus_client import Counter, Histogram
from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import ClientDisconnect
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from grader.gate.admission import is_api
from grader.gate.head import ask_as_get
from grader.gate.problems import problem_of_unexpected
from grader.metrics import REQUEST_S, REQUESTS
from grader.store.engine.database import driver_error, is_away

log = structlog.get_logger()

REQUEST_ID = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{7,63}")
"""An `X-Request-ID` of a caller that is taken over; for any other text a new one is made."""

METHODS = frozenset({"GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"})


class RequestsMiddleware:
    """ASGI middleware. Names every request by an id that its response, its problems and its log lines bear. A HEAD is
    asked and logged as a GET."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serves the request, and logs how it went; an unexpected error is logged, and answered with 500 or 503."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        if scope["method"] == "HEAD":
            scope, receive, send = ask_as_get(scope, receive, send)
        sent = Headers(scope=scope).get("x-request-id", "")
        request_id = sent if REQUEST_ID.fullmatch(sent) else f"{getrandbits(128):032x}"
        response = NamedResponse(scope, send, request_id)
        structlog.contextvars.bind_contextvars(request_id=request_id)  # the context is the request's own
        try:
            await self.app(scope, receive, response.send)
        except ClientDisconnect:  # before its request was read: no answer can reach it
            return
        except Exception as error:
            if is_away(error):
                scope.setdefault("state", {})["why"] = f"database: {driver_error(error)}"
            else:
                log.exception("unhandled", method=scope["method"], path=scope["path"])
            if not response.status:  # else the connection is closed
                await problem_of_unexpected(error)(scope, receive, response.send)
        finally:
            response.log()


class NamedResponse:
    """Sends a response with the id of its request, and logs it before its last part is out. API responses are never
    cached for another user."""

    def __init__(self, scope: Scope, send: Send, request_id: str) -> None:
        self._scope, self._send, self._id = scope, send, request_id
        self._began, self._is_logged = time.perf_counter(), False
        self.status = 0
        """0 until the response has started."""

    async def send(self, message: Message) -> None:
        """Sends one part."""
        if message["type"] == "http.response.start":
            self.status = message["status"]
            headers = MutableHeaders(scope=message)
            headers.append("X-Request-ID", self._id)
            if is_api(self._scope):
                headers.setdefault("Cache-Control", "private, no-cache")
                headers.append("X-Content-Type-Options", "nosniff")
        elif not message.get("more_body", False):
            self.log()
        await self._send(message)

    def log(self) -> None:
        """Counts and logs the request, once."""
        if not self._is_logged:
            self._is_logged = True
            log_request(self._scope, self.status, time.perf_counter() - self._began)


def log_request(scope: Scope, status: int, seconds: float) -> None:
    """Counts and logs a request. Status 0: the client left before it got one."""
    route, method = get_template(scope), scope["method"] if scope["method"] in METHODS else "other"
    count, times = get_metrics(method, route, str(status))
    count.inc()
    times.observe(seconds)
    state: dict[str, Any] = scope.get("state", {})
    identity = state.get("identity")
    line = {"method": method, "route": route, "status": status, "ms": round(seconds * 1000, 1)}
    if identity is not None:
        line["user"] = identity.id
    if why := state.get("why"):
        line["why"] = why
    log.info("request", **line)


@cache
def get_metrics(method: str, route: str, status: str) -> tuple[Counter, Histogram]:
    """Returns the metrics of such requests; looked up once, since for Prometheus that takes longer than to count."""
    return REQUESTS.labels(method, route, status), REQUEST_S.labels(route)


def get_template(scope: Scope) -> str:
    """The path of the request's route with its parameters unfilled, as in OpenAPI; `-` where no route was reached."""
    path: str = getattr(scope.get("route"), "path", "-")
    return path
