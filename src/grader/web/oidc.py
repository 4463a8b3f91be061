"""`/oidc`: sign-in at an OpenID provider. Not found unless the settings name one."""

import secrets
from datetime import timedelta

import structlog
from fastapi import APIRouter, Request
from fastapi.responses import RedirectResponse, Response

from grader.errors import NotFound, Unauthorized
from grader.web.context import PageContext, Pages
from grader.web.provider import FAILED, Attempt, Provider
from grader.web.signin import signed_in

router = APIRouter(include_in_schema=False, prefix="/oidc")
log = structlog.get_logger()

COOKIE = "grader_oidc"
IN_PROGRESS = timedelta(minutes=10)


@router.get("/login")
def begin(request: Request, pages: Pages) -> Response:
    """Sends the browser to the provider. Nothing is stored here: the state travels in a cookie."""
    provider, attempt = provider_of(pages), Attempt()
    try:
        address = provider.address(attempt, redirect_uri_of(pages, request))
    except Exception as error:
        log.exception("the OIDC provider cannot be reached")
        raise Unauthorized("The sign-in service cannot be reached. Try again later.") from error
    return RedirectResponse(address, 303, {"Set-Cookie": cookie(pages, str(attempt), IN_PROGRESS)})


@router.get("/callback")
def finish(request: Request, pages: Pages, code: str = "", state: str = "") -> Response:
    """Opens a session for a browser that returns from the provider. Raises Unauthorized, Forbidden, NotFound."""
    provider = provider_of(pages)
    attempt = Attempt.read(request.cookies.get(cookie_name(pages), ""))
    if not code or not secrets.compare_digest(attempt.state.encode(), state.encode()):
        raise Unauthorized(FAILED)
    claims = provider.claims(attempt, code, redirect_uri_of(pages, request))
    opened = pages.sessions.writing(lambda session: provider.open_session(session, claims))
    pages.sessions.end(request.cookies)
    response = signed_in(pages, opened)
    response.headers.append("Set-Cookie", cookie(pages, "", timedelta()))
    return response


def provider_of(pages: PageContext) -> Provider:
    """The provider of the settings. Raises NotFound without one."""
    if pages.provider is None:
        raise NotFound("There is no sign-in by OpenID Connect here.")
    return pages.provider


def redirect_uri_of(pages: PageContext, request: Request) -> str:
    """The address to register with the provider."""
    return f"{pages.origin_of(request)}/oidc/callback"


def cookie_name(pages: PageContext) -> str:
    """Returns the name; under https with the prefix that binds the cookie to this host."""
    return f"__Host-{COOKIE}" if pages.sessions.secure else COOKIE


def cookie(pages: PageContext, value: str, lifetime: timedelta) -> str:
    """The `Set-Cookie` header of a sign-in in progress."""
    secure = "; Secure" if pages.sessions.secure else ""
    age = int(lifetime.total_seconds())
    return f"{cookie_name(pages)}={value}; Max-Age={age}; Path=/; HttpOnly; SameSite=Lax{secure}"
