"""What pages in a learning platform's frame have in common: cookies, security policy, and plain words for a refusal."""

from collections.abc import Callable, Coroutine
from typing import Annotated, Any
from urllib.parse import parse_qsl

from fastapi import Depends, Request
from fastapi.responses import Response

from grader.courses.people.sign_in import BrowserSession
from grader.domain.platform import Platform
from grader.errors import CallerError, Conflict, Forbidden, NotFound, Unauthorized, Unprocessable
from grader.gate.late_routes import LateRoute
from grader.gate.services import AppServices, Services
from grader.platforms.tool import MISSING, Tool
from grader.web.frame.rendering import POLICY, PRIVATE, page, security_policy

FIELDS_MAX = 60
REFUSALS = (Unauthorized, Forbidden, NotFound, Conflict, Unprocessable)
STATUS: dict[type[CallerError], int] = {Unauthorized: 401, Forbidden: 403, NotFound: 404, Conflict: 409}
ANYWHERE = {POLICY: security_policy(["*"])}
"""A refusal has nothing to press, so any site may show it: the platform's administrator must be able to read it."""


async def get_tool(services: AppServices) -> Tool:
    """Returns the LTI tool. Raises NotFound, which says what to install."""
    if services.tool is None:
        raise NotFound(MISSING)
    return services.tool


LtiTool = Annotated[Tool, Depends(get_tool)]


async def read_pairs(request: Request) -> list[tuple[str, str]]:
    """Returns the parameters of a request, by GET or as a form, each as often as it is there. Raises Unprocessable."""
    text = request.url.query if request.method == "GET" else (await request.body()).decode(errors="replace")
    try:
        return parse_qsl(text, keep_blank_values=True, max_num_fields=FIELDS_MAX)
    except ValueError as error:
        raise Unprocessable(f"At most {FIELDS_MAX} parameters are taken.") from error


Pairs = Annotated[list[tuple[str, str]], Depends(read_pairs)]


class PlainWords(LateRoute):
    """A route that shows the reader of a frame a refusal as a page."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """Returns the handler of a request."""
        handle = super().get_route_handler()

        async def handle_refusals(request: Request) -> Response:
            try:
                return await handle(request)
            except REFUSALS as error:
                if str(error) == MISSING:  # the same text as in the API
                    raise
                return show_refusal(request, error)

        return handle_refusals


def show_refusal(request: Request, error: CallerError) -> Response:
    """Renders the page that says why something was refused."""
    status = next((status for kind, status in STATUS.items() if isinstance(error, kind)), 422)
    return page(request, "lti_message.html", status, PRIVATE | ANYWHERE, why=str(error))


def show_framed(
    request: Request, template: str, platform: Platform, posts_to: tuple[str, ...] = (), **context: Any
) -> Response:
    """Renders a page of a launch, which this platform alone may show in a frame."""
    headers = PRIVATE | {POLICY: security_policy(platform.origins, posts_to)}
    return page(request, template, 200, headers, **context)


def start_session_in(request: Request, services: Services, response: Response, opened: BrowserSession) -> Response:
    """Renders the response, with the cookie of a session in the frame or tab that it is shown in."""
    framed = request.headers.get("sec-fetch-dest") != "document"  # as far as the browser says so
    response.headers.append("Set-Cookie", services.sessions.set_cookie(opened, framed=framed))
    return response
