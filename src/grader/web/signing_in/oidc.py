"""`/oidc`: sign-in at an OpenID provider. Not found unless the settings name one."""

import secrets
from datetime import timedelta

import structlog
from fastapi import Request
from fastapi.responses import RedirectResponse, Response

from grader.errors import NotFound, Unauthorized
from grader.gate.late_routes import page_router
from grader.gate.openid import FAILED, Attempt, Provider
from grader.gate.services import AppServices, Services
from grader.web.signing_in.links import redirect_signed_in

router = page_router("/oidc")
log = structlog.get_logger()

COOKIE = "grader_oidc"
IN_PROGRESS = timedelta(minutes=10)


@router.get("/login")
def begin(request: Request, services: AppServices) -> Response:
    """Sends the browser to the provider. Nothing is stored here: the state travels in a cookie."""
    provider, attempt = get_provider(services), Attempt()
    try:
        address = provider.address(attempt, make_redirect_uri(services, request))
    except Exception as error:
        log.exception("the OIDC provider cannot be reached")
        raise Unauthorized("The sign-in service cannot be reached. Try again later.") from error
    return RedirectResponse(address, 303, {"Set-Cookie": make_cookie(services, str(attempt), IN_PROGRESS)})


@router.get("/callback")
def finish(request: Request, services: AppServices, code: str = "", state: str = "") -> Response:
    """Opens a session for a browser that returns from the provider. Raises Unauthorized, Forbidden, NotFound."""
    provider = get_provider(services)
    attempt = Attempt.read(request.cookies.get(name_cookie(services), ""))
    if not code or not secrets.compare_digest(attempt.state.encode(), state.encode()):
        raise Unauthorized(FAILED)
    claims = provider.claims(attempt, code, make_redirect_uri(services, request))
    opened = services.sessions.writing(lambda session: provider.open_session(session, claims))
    response = redirect_signed_in(request, services, opened)
    response.headers.append("Set-Cookie", make_cookie(services, "", timedelta()))
    return response


def get_provider(services: Services) -> Provider:
    """Returns the provider of the settings. Raises NotFound without one."""
    if services.provider is None:
        raise NotFound("There is no sign-in by OpenID Connect here.")
    return services.provider


def make_redirect_uri(services: Services, request: Request) -> str:
    """Returns the address to register with the provider."""
    return f"{services.origin_of(request)}/oidc/callback"


def name_cookie(services: Services) -> str:
    """Returns the name; under https with the prefix that binds the cookie to this host."""
    return f"__Host-{COOKIE}" if services.sessions.secure else COOKIE


def make_cookie(services: Services, value: str, lifetime: timedelta) -> str:
    """Returns the `Set-Cookie` header of a sign-in in progress."""
    secure = "; Secure" if services.sessions.secure else ""
    age = int(lifetime.total_seconds())
    return f"{name_cookie(services)}={value}; Max-Age={age}; Path=/; HttpOnly; SameSite=Lax{secure}"
