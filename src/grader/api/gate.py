"""What every request passes before any route: host, size, and under /api/v1 who is asking, from where, how often.

It stands outside the routes because 401 comes before everything that reading a body or a path could find.
"""

from dataclasses import dataclass
from http.cookies import CookieError, SimpleCookie
from urllib.parse import urlsplit

import structlog
from fastapi.concurrency import run_in_threadpool
from starlette.datastructures import Headers, MutableHeaders
from starlette.exceptions import HTTPException
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from grader.api.problems import problem, problem_of
from grader.api.rate import RateLimit
from grader.errors import CallerError, Forbidden
from grader.identity import COOKIE, SECURE_COOKIE, Identity, authenticate
from grader.store.database import Database

log = structlog.get_logger()

PREFIX = "/api/v1"
SAFE_METHODS = ("GET", "HEAD", "OPTIONS")


@dataclass(frozen=True)
class Rules:
    """What the gate goes by. `hosts` are names without port; `origin` is the public one, None on loopback."""

    hosts: frozenset[str]
    origin: str | None
    body_bytes_max: int


class Gate:
    """ASGI middleware. Routes under /api/v1 find the Identity at `request.state.identity`."""

    def __init__(self, app: ASGIApp, database: Database, rules: Rules, limit: RateLimit) -> None:
        self.app, self.database, self.rules, self.limit = app, database, rules, limit

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Lets the request through or answers it with a problem; what breaks inside is 500, told in the log alone."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        response = Reply(scope, send)
        try:
            await self._pass(scope, receive, response.send)
        except Exception:
            log.exception("unhandled", method=scope["method"], path=scope["path"])
            if response.started:
                raise
            await problem(500, "Something went wrong on our side.")(scope, receive, response.send)

    async def _pass(self, scope: Scope, receive: Receive, send: Send) -> None:
        headers = Headers(scope=scope)
        if not self._is_our_host(headers):
            await problem(421, "This service does not answer to that host name.")(scope, receive, send)
            return
        try:
            await self._admit(scope, headers)
        except CallerError as error:
            await problem_of(error)(scope, receive, send)
            return
        await self.app(scope, self._sized(headers, receive), send)

    def _is_our_host(self, headers: Headers) -> bool:
        try:
            return urlsplit(f"//{headers.get('host', '')}").hostname in self.rules.hosts
        except ValueError:
            return False

    async def _admit(self, scope: Scope, headers: Headers) -> None:
        unsafe = scope["method"] not in SAFE_METHODS
        cookies = read_cookies(headers)
        if not is_api(scope):
            by_browser = cookies or "origin" in headers or "sec-fetch-site" in headers
            if unsafe and by_browser and not self._is_same_origin(headers):
                raise Forbidden("This form must be sent from its own page.")
            return
        identity = await run_in_threadpool(authenticate, self.database, headers.get("authorization"), cookies)
        if unsafe and identity.by_cookie and not self._is_same_origin(headers):
            raise Forbidden("A browser may send this from the service's own pages only.")
        self.limit.spend((identity.course, identity.user))
        scope.setdefault("state", {})["identity"] = identity

    def _is_same_origin(self, headers: Headers) -> bool:
        """By what the browser itself says of the request; what says nothing is not believed."""
        site = headers.get("sec-fetch-site")
        if site is not None:
            return site == "same-origin"
        origin = headers.get("origin", "")
        if self.rules.origin is not None:
            return origin == self.rules.origin
        return origin.partition("://")[2] == headers.get("host")

    def _sized(self, headers: Headers, receive: Receive) -> Receive:
        """`receive`, refusing a body as soon as it is known to be too large."""
        received = 0
        announced = headers.get("content-length", "")

        async def receive_sized() -> Message:
            nonlocal received
            message = await receive()
            received += len(message.get("body", b""))
            if max(received, int(announced) if announced.isdecimal() else 0) > self.rules.body_bytes_max:
                raise HTTPException(413, f"At most {self.rules.body_bytes_max // 1024} KB are taken.")
            return message

        return receive_sized


def is_api(scope: Scope) -> bool:
    """Whether the path lies under /api/v1."""
    path: str = scope["path"]
    return path == PREFIX or path.startswith(f"{PREFIX}/")


def read_cookies(headers: Headers) -> dict[str, str]:
    """Our cookies among those that were sent."""
    try:
        jar = SimpleCookie(headers.get("cookie", ""))
    except CookieError:
        return {}
    return {name: jar[name].value for name in (SECURE_COOKIE, COOKIE) if name in jar}


class Reply:
    """An answer on its way out: what the API says is for one person, and is what it says it is."""

    def __init__(self, scope: Scope, send: Send) -> None:
        self.scope, self._send, self.started = scope, send, False

    async def send(self, message: Message) -> None:
        """Sends a part of it."""
        if message["type"] == "http.response.start":
            self.started = True
            if is_api(self.scope):
                headers = MutableHeaders(scope=message)
                headers.setdefault("Cache-Control", "private, no-cache")
                headers["X-Content-Type-Options"] = "nosniff"
        await self._send(message)


def identity_in(scope: Scope) -> Identity:
    """Who was let through."""
    identity: Identity = scope["state"]["identity"]
    return identity
