"""What is checked of every request before its route: host, identity, rate, origin and size. It is a middleware, and no
dependency of the routes, because 401 comes before any error of body or path."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from urllib.parse import urlsplit

from fastapi.concurrency import run_in_threadpool
from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.requests import HTTPConnection
from starlette.routing import BaseRoute, Match
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from grader.courses.people.identity import FAILED, CredentialCache, Identity, Role, authenticate
from grader.courses.people.identity import Scope as TokenScope
from grader.errors import CallerError, Forbidden, Unauthorized, Unprocessable
from grader.gate.compression import CompressionMiddleware
from grader.gate.conditional import ConditionalMiddleware
from grader.gate.problems import describe_problem, problem
from grader.gate.rate import RateLimit, read_address
from grader.gate.scopes import find_scope
from grader.store.engine.database import Database

OTHER_HOST = (
    "This service does not answer to that host name. Its operator names those of it in GRADER_PUBLIC_ORIGIN and "
    "GRADER_ALLOWED_HOSTS."
)

PREFIX = "/api/v1"
SUBMISSIONS = f"{PREFIX}/submissions"
ON_BEHALF = f"{PREFIX}/lms/submissions"
VALIDATE = f"{PREFIX}/answers:validate"
SAFE_METHODS = ("GET", "HEAD", "OPTIONS")
DEFAULT_PORTS = {"http": 80, "https": 443}

SMALL_BODY_BYTES_MAX = 64 * 1024
"""Largest body where neither a script nor a file is handed in."""

ANSWERING = frozenset({SUBMISSIONS, ON_BEHALF, VALIDATE})
LARGE_BODIES = ANSWERING | {f"{PREFIX}/roster:import"}
"""Routes of the API that take a script or a file, as large as the settings allow."""

COMMAS_MAX = 40_000
"""Most commas of a body with a script: JSON is read in the event loop, at up to 0.4 us for each key or value.

A script of 256 KB has fewer unless it is a table of numbers.
"""

DEVICES = frozenset({f"{PREFIX}/devices", f"{PREFIX}/devices:token"})
"""Where a device asks for a token: it has none yet, and its code proves what its owner has confirmed."""

ANSWERS = "/quizzes/"
"""Where pages send answers as forms."""

ANSWER_BODY_BYTES_MAX = 800 * 1024
"""Largest such form: a script of 256 KB, of which a form writes most signs with three."""

FOREIGN_FORMS = ("/lti/login", "/lti/launch")
"""Where learning platforms let the browser post to: a signed token and the login that it answers prove them."""

BYTES_PER_REQUEST = 1024
"""Bytes of such a body that count as one more request: the time to parse it grows with them."""
BYTES_PER_ANSWER = 16 * 1024
"""The same for a form with an answer, which is parsed outside the event loop."""


@dataclass(frozen=True)
class AdmissionRules:
    """Which requests are admitted, and how many. `hosts` are names without port; `origin` is the public one, None on
    loopback. Requests with a valid token or session count `by_user`, all others `by_address`."""

    hosts: frozenset[str]
    origin: str | None
    body_bytes_max: int
    by_user: RateLimit
    by_address: RateLimit


class AdmissionMiddleware:
    """ASGI middleware. Routes find the Identity at `request.state.identity`; outside /api/v1 it may be None."""

    def __init__(self, app: ASGIApp, database: Database, rules: AdmissionRules, routes: Sequence[BaseRoute]) -> None:
        self.app, self.database, self.rules, self.routes = app, database, rules, routes
        self.documents = CompressionMiddleware(ConditionalMiddleware(app))
        """The app for GET, whose answers may come again and be long."""
        self.recalled = CredentialCache()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serves the request, or answers it with a problem."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        drop_escaped_cookies(scope)
        headers = Headers(scope=scope)
        if not self._is_our_host(headers):
            await problem(421, OTHER_HOST)(scope, receive, send)
            return
        try:
            await self._admit(scope, headers)
        except CallerError as error:
            await describe_problem(error)(scope, receive, send)
            return
        app = self.documents if scope["method"] == "GET" else self.app
        await app(scope, self._limit_body(scope, headers, receive), send)

    def _is_our_host(self, headers: Headers) -> bool:
        return hostname_of(headers.get("host", "")) in self.rules.hosts

    async def _admit(self, scope: Scope, headers: Headers) -> None:
        """Sets the identity of a request. Raises Unauthorized, Forbidden, TooManyRequests, Unprocessable."""
        identity: Identity | None
        try:
            identity = await self._identify(scope, headers)
        except Unauthorized:
            self.rules.by_address.spend(read_address(scope), count_cost(scope, headers))
            if is_api(scope) and scope["path"] not in DEVICES:
                raise
            identity = None
        else:
            if not counts_by_learner(scope, identity):
                self.rules.by_user.spend(identity.id, count_cost(scope, headers))
        if is_forgeable(scope, headers, identity) and not self._is_same_origin(scope, headers):
            raise Forbidden("A browser may send this from the service's own pages only.")
        if identity is not None and identity.scopes is not None and is_api(scope):
            self._require_scope(scope, identity)
        if "\0" in scope["path"] or b"%00" in scope["query_string"]:  # PostgreSQL keeps no NUL, and looks for none
            raise Unprocessable("An address has no character NUL.")
        scope.setdefault("state", {})["identity"] = identity

    def _require_scope(self, scope: Scope, identity: Identity) -> None:
        """Raises Forbidden if a restricted token may not do this. What no route does is left to the router, which says
        so with 404 or 405: a token of more rights would be of no help."""
        try:
            identity.require_scope(find_scope(scope["method"], scope["path"].removeprefix(PREFIX)))
        except Forbidden:
            if any(route.matches(scope)[0] is Match.FULL for route in self.routes):
                raise

    async def _identify(self, scope: Scope, headers: Headers) -> Identity:
        """The user, by token or cookie; outside /api/v1 by cookie alone. Raises Unauthorized. An answer is asked for
        its credential again where it is stored, so a recalled identity will do."""
        authorization = headers.get("authorization") if is_api(scope) else None
        cookies = HTTPConnection(scope).cookies if "cookie" in headers else {}
        if scope["path"] in DEVICES or (authorization is None and not cookies):
            raise Unauthorized(FAILED)
        if hands_in(scope) and (known := self.recalled.get(authorization, cookies)) is not None:
            return known
        identity = await run_in_threadpool(authenticate, self.database, authorization, cookies)
        self.recalled.put(authorization, cookies, identity)
        return identity

    def _is_same_origin(self, scope: Scope, headers: Headers) -> bool:
        """Whether the browser's own headers say so; a request without them counts as cross-origin."""
        site = headers.get("sec-fetch-site")
        if site is not None:
            return site == "same-origin"
        own = self.rules.origin or f"{scope['scheme']}://{headers.get('host')}"
        return read_origin(headers.get("origin", "")) == read_origin(own)

    def _find_bytes_max(self, scope: Scope) -> int:
        """Returns the largest body that is taken at a path."""
        if scope["path"] in LARGE_BODIES:
            return self.rules.body_bytes_max
        return min(self.rules.body_bytes_max, SMALL_BODY_BYTES_MAX) if is_api(scope) else page_bytes_max(scope)

    def _limit_body(self, scope: Scope, headers: Headers, receive: Receive) -> Receive:
        """Wraps `receive` to raise 413 as soon as a body is known to be too large; an announced size is kept to."""
        bytes_max = self._find_bytes_max(scope)
        commas_max = COMMAS_MAX if scope["path"] in ANSWERING else bytes_max
        announced, received, commas = announced_bytes(headers), 0, 0
        if announced is not None and announced <= min(bytes_max, SMALL_BODY_BYTES_MAX):
            return receive

        async def receive_limited() -> Message:
            nonlocal received, commas
            message = await receive()
            body = message.get("body", b"")
            received, commas = received + len(body), commas + body.count(b",")
            if max(received, announced or 0) > bytes_max:
                raise HTTPException(413, f"At most {bytes_max // 1024} KB are taken.")
            if commas > commas_max:
                raise HTTPException(413, f"At most {commas_max} commas are taken: shorten the tables of the script.")
            return message

        return receive_limited


def is_api(scope: Scope) -> bool:
    """Whether the path lies under /api/v1."""
    path: str = scope["path"]
    return path == PREFIX or path.startswith(f"{PREFIX}/")


def page_bytes_max(scope: Scope) -> int:
    """The largest body outside /api/v1 at a path."""
    path: str = scope["path"]
    return ANSWER_BODY_BYTES_MAX if path.startswith(ANSWERS) else SMALL_BODY_BYTES_MAX


def is_forgeable(scope: Scope, headers: Headers, identity: Identity | None) -> bool:
    """Whether another site could make a browser send this request, with the user's cookies, to change something."""
    if scope["method"] in SAFE_METHODS or scope["path"] in FOREIGN_FORMS:
        return False
    if identity is not None and is_api(scope):
        return identity.by_cookie
    return any(name in headers for name in ("cookie", "origin", "sec-fetch-site"))


def hands_in(scope: Scope) -> bool:
    """Whether the request hands in an answer."""
    return bool(scope["method"] == "POST" and scope["path"] in (SUBMISSIONS, ON_BEHALF))


def counts_by_learner(scope: Scope, identity: Identity) -> bool:
    """Whether a service hands in for a learner: the route counts such requests, by the learner whom the body names."""
    may = identity.role is Role.SERVICE and (identity.scopes is None or TokenScope.LMS in identity.scopes)
    return may and hands_in(scope) and scope["path"] == ON_BEHALF


async def authenticate_again(scope: Scope, database: Database) -> None:
    """Raises Unauthorized if the credential of an admitted API request has ended meanwhile: 401 comes before others."""
    request = HTTPConnection(scope)
    await run_in_threadpool(authenticate, database, request.headers.get("authorization"), request.cookies)


def count_cost(scope: Scope, headers: Headers) -> int:
    """How many requests this one counts as: outside /api/v1 one more for each KB of its body, or 16 KB of an answer."""
    if is_api(scope):
        return 1
    bytes_max = page_bytes_max(scope)
    unit = BYTES_PER_REQUEST if bytes_max == SMALL_BODY_BYTES_MAX else BYTES_PER_ANSWER
    announced = announced_bytes(headers)
    return 1 + min(bytes_max if announced is None else announced, bytes_max) // unit


def announced_bytes(headers: Headers) -> int | None:
    """The length of a body, which the server has it keep to; 0 without one, None where only its end will tell."""
    announced = headers.get("content-length", "0")
    return int(announced) if announced.isdecimal() and "transfer-encoding" not in headers else None


@lru_cache(maxsize=100)
def hostname_of(host: str) -> str | None:
    """The name in a Host header; None if it has none."""
    try:
        return urlsplit(f"//{host}").hostname
    except ValueError:
        return None


def read_origin(url: str) -> tuple[str, str | None, int | None] | None:
    """Scheme, host and port of a URL; None if it has none."""
    try:
        parts = urlsplit(url)
        return parts.scheme, parts.hostname, parts.port or DEFAULT_PORTS.get(parts.scheme)
    except ValueError:
        return None


def drop_escaped_cookies(scope: Scope) -> None:
    """Removes cookies with a backslash, which no cookie of ours has. `http.cookies` takes time quadratic in their
    number before Python 3.11.10 and 3.12.6 (CVE-2024-7592)."""
    scope["headers"] = [
        (name, b";".join(pair for pair in value.split(b";") if b"\\" not in pair) if name == b"cookie" else value)
        for name, value in scope["headers"]
    ]


def get_identity(scope: Scope) -> Identity:
    """The identity of an admitted API request."""
    identity: Identity = scope["state"]["identity"]
    return identity
