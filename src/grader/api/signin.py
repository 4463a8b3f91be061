"""`/signin`: a one-time code becomes a browser session; on loopback a learner gets one without asking."""

from dataclasses import dataclass
from html import escape
from urllib.parse import parse_qs

from fastapi import APIRouter, Request
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import HTMLResponse, RedirectResponse, Response
from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from grader.api.gate import read_cookies
from grader.errors import Unauthorized
from grader.identity import (
    COOKIE,
    LEARNER_SESSION,
    SECURE_COOKIE,
    Identity,
    authenticate,
    end_session,
    redeem_sign_in_code,
    start_anonymous_session,
)
from grader.store.database import Database

router = APIRouter(include_in_schema=False)

PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<meta name="referrer" content="no-referrer"><title>Sign in</title></head>
<body><main><h1>Sign in</h1><form method="post" action="/signin">
<input type="hidden" name="code" value="{code}"><button autofocus>Sign in</button>
</form></main></body></html>
"""


@dataclass(frozen=True)
class Doorstep:
    """How sessions are handed out: `secure` under https; `anonymous` where whoever opens the page may answer."""

    database: Database
    secure: bool
    anonymous: bool

    def cookie(self, secret: str) -> str:
        """The Set-Cookie header of a session."""
        age = int(LEARNER_SESSION.total_seconds())
        if self.secure:
            return f"{SECURE_COOKIE}={secret}; Max-Age={age}; Path=/; HttpOnly; SameSite=Lax; Secure"
        return f"{COOKIE}={secret}; Max-Age={age}; Path=/; HttpOnly; SameSite=Lax"

    def redeem(self, code: str) -> tuple[Identity, str]:
        """As `redeem_sign_in_code`, in a transaction of its own."""
        with self.database.write() as session:
            return redeem_sign_in_code(session, code)

    def welcome(self, cookies: dict[str, str]) -> str | None:
        """A new anonymous session for a browser without a valid one."""
        try:
            authenticate(self.database, None, cookies)
        except Unauthorized:
            with self.database.write() as session:
                return start_anonymous_session(session)
        return None

    def sign_out(self, cookies: dict[str, str]) -> None:
        """Ends the browser's session."""
        with self.database.write() as session:
            for cookie in cookies.values():
                end_session(session, cookie)


class Welcome:
    """ASGI middleware: who opens `/` on loopback without a session gets one, and can answer at once."""

    def __init__(self, app: ASGIApp, doorstep: Doorstep) -> None:
        self.app, self.doorstep = app, doorstep

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Adds the cookie to the answer."""
        opens_page = scope["type"] == "http" and (scope["method"], scope["path"]) == ("GET", "/")
        if not (self.doorstep.anonymous and opens_page):
            await self.app(scope, receive, send)
            return
        secret = await run_in_threadpool(self.doorstep.welcome, read_cookies(Headers(scope=scope)))

        async def send_with_cookie(message: Message) -> None:
            if secret is not None and message["type"] == "http.response.start":
                MutableHeaders(scope=message).append("Set-Cookie", self.doorstep.cookie(secret))
            await send(message)

        await self.app(scope, receive, send_with_cookie)


@router.get("/signin")
async def ask(code: str = "") -> Response:
    """A button: programs that follow links, in mail for one, must not use the code up."""
    headers = {"Cache-Control": "no-store", "Referrer-Policy": "no-referrer"}
    return HTMLResponse(PAGE.format(code=escape(code, quote=True)), headers=headers)


@router.post("/signin")
async def sign_in(request: Request) -> Response:
    """Uses the code up, and goes on to the page of whom it was for."""
    doorstep: Doorstep = request.app.state.doorstep
    form = parse_qs((await request.body()).decode(errors="replace"))
    identity, secret = await run_in_threadpool(doorstep.redeem, form.get("code", [""])[0])
    page = "/instructor" if identity.is_instructor else "/"
    return RedirectResponse(page, 303, {"Set-Cookie": doorstep.cookie(secret), "Cache-Control": "no-store"})


@router.post("/signout")
async def sign_out(request: Request) -> Response:
    """Ends the session."""
    doorstep: Doorstep = request.app.state.doorstep
    await run_in_threadpool(doorstep.sign_out, read_cookies(request.headers))
    name, secure = (SECURE_COOKIE, "; Secure") if doorstep.secure else (COOKIE, "")
    gone = f"{name}=; Max-Age=0; Path=/; HttpOnly; SameSite=Lax{secure}"
    return RedirectResponse("/", 303, {"Set-Cookie": gone})
