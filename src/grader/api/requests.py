"""What is told of every request: its id, one line in the log, and its place in the metrics."""

import re
import secrets
import time
from typing import Any

import structlog
from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from grader.api.admission import PREFIX, is_api
from grader.metrics import REQUEST_S, REQUESTS

log = structlog.get_logger()

REQUEST_ID = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{7,63}")
"""An `X-Request-ID` of a caller that is taken over; for any other text a new one is made."""

METHODS = frozenset({"GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"})


class RequestsMiddleware:
    """ASGI middleware. Names every request by an id that its response, its problems and its log lines bear."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serves the request, and tells how it went when its response has ended."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        given = Headers(scope=scope).get("x-request-id", "")
        request_id = given if REQUEST_ID.fullmatch(given) else secrets.token_hex(16)
        status, began = 0, time.perf_counter()

        async def send_named(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
                MutableHeaders(scope=message)["X-Request-ID"] = request_id
            await send(message)

        with structlog.contextvars.bound_contextvars(request_id=request_id):
            try:
                await self.app(scope, receive, send_named)
            finally:
                tell(scope, status, time.perf_counter() - began)


def tell(scope: Scope, status: int, seconds: float) -> None:
    """Counts and logs a request. Status 0: the client left before it got one."""
    route, method = template_of(scope), scope["method"] if scope["method"] in METHODS else "other"
    REQUESTS.labels(method, route, str(status)).inc()
    REQUEST_S.labels(route).observe(seconds)
    state: dict[str, Any] = scope.get("state", {})
    identity = state.get("identity")
    told = {"method": method, "route": route, "status": status, "ms": round(seconds * 1000, 1)}
    if identity is not None:
        told["user"] = identity.id
    if why := state.get("why"):
        told["why"] = why
    log.info("request", **told)


def template_of(scope: Scope) -> str:
    """The path of the request's route with its parameters unfilled, as in OpenAPI; `-` where no route was reached."""
    path: str = getattr(scope.get("route"), "path", "-")
    return f"{PREFIX}{path}" if is_api(scope) and path != "-" else path
