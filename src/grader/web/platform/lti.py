"""`/lti`: logins and launches of learning platforms, and what they fetch of this tool."""

from urllib.parse import quote, urlencode

import structlog
from fastapi import Request
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import JSONResponse, RedirectResponse, Response

from grader.courses.people.identity import Role
from grader.errors import Forbidden, Unauthorized, Unprocessable
from grader.gate.late_routes import page_router
from grader.gate.services import AppServices, Services
from grader.library import Library
from grader.platforms.launching import login as logins
from grader.platforms.launching.addresses import read_origin
from grader.platforms.launching.arrival import NOT_APPROVED, Arrival, arrive, find_reviewed
from grader.platforms.launching.id_token import verify
from grader.platforms.launching.launch import Launch, read_launch
from grader.platforms.launching.login import AnsweredLogin, Login, UnboundLogin
from grader.platforms.tool import canvas_configuration
from grader.questions import kind_of
from grader.web.platform.forms import enter, show_button, show_choices, show_course_form
from grader.web.platform.forms import router as forms
from grader.web.platform.frames import LtiTool, Pairs, PlainWords, show_framed

router = page_router("/lti")
router.routes.extend(forms.routes)
launches = page_router("/lti", route_class=PlainWords)
log = structlog.get_logger()

PUBLIC = {"Cache-Control": "public, max-age=300", "X-Content-Type-Options": "nosniff"}
UNLINKED = (
    "This course is not linked with a course of the grader yet. Its instructor links it by opening this link, "
    "or any other one that leads here."
)
FIELDS = ("state", "id_token", "key", "error")


@router.get("/keys.json")
def public_keys(tool: LtiTool) -> Response:
    """The public keys with which platforms verify what this tool signs."""
    return JSONResponse(tool.keys.public(), headers=PUBLIC)


@router.get("/canvas.json")
def for_canvas(request: Request, tool: LtiTool, services: AppServices) -> Response:
    """What Canvas asks for when a developer key is made by address."""
    return JSONResponse(canvas_configuration(services.origin_of(request)), headers=PUBLIC)


@launches.get("/login")
@launches.post("/login")
def begin(request: Request, _tool: LtiTool, services: AppServices, pairs: Pairs) -> Response:
    """Begins a login, and sends the browser to the platform, which knows who its user is."""
    fields, origin = logins.read_fields(pairs), services.origin_of(request)
    begun = services.sessions.writing(lambda session: logins.begin(session, fields, origin))
    if begun.storage:
        response: Response = show_framed(
            request, "lti_storage.html", begun.platform, origin=read_origin(begun.platform.login_url),
            storage=begun.storage, name=logins.make_name(begun.state), key=begun.key, address=begun.address, form=None,
        )  # fmt: skip
    else:
        response = RedirectResponse(begun.address, 303, {"Cache-Control": "no-store"})
    response.headers.append("Set-Cookie", make_key_cookie(services, begun))
    return response


@launches.post("/launch")
async def launch(request: Request, tool: LtiTool, services: AppServices, pairs: Pairs) -> Response:
    """Verifies a launch, and opens the quiz or question that it leads to, in a session of the linked course."""
    form = parse_form(pairs)
    if "error" in form:
        log.info("a platform refused a login", error=form["error"][:100])
        raise Unauthorized("Your learning platform did not sign you in. Sign in there, then open this link again.")
    state, cookie = form.get("state", ""), request.cookies.get(name_cookie(services, form.get("state", "")), "")
    answered = await run_in_threadpool(
        services.sessions.writing, lambda session: logins.answer(session, state, cookie or form.get("key", ""))
    )
    if isinstance(answered, UnboundLogin):
        return bind_otherwise(request, services, answered, form)
    verified = await verify_launch(tool, services.origin_of(request), answered, form.get("id_token", ""))
    return await run_in_threadpool(settle, request, services, verified, in_tab=not cookie)


async def verify_launch(tool: LtiTool, origin: str, answered: AnsweredLogin, id_token: str) -> Launch:
    """Returns the launch in a token. Raises Unauthorized; the log tells why, and which platform."""
    try:
        claims = await verify(id_token, answered.platform, answered.nonce, tool.platform_keys)
        return read_launch(claims, answered.platform, origin)
    except Unauthorized as error:
        log.warning("a launch was refused", platform=answered.platform.id, why=str(error))
        raise


def parse_form(pairs: list[tuple[str, str]]) -> dict[str, str]:
    """Returns the fields of a launch. Raises Unprocessable if one is there twice."""
    known = [(name, value) for name, value in pairs if name in FIELDS]
    if len(dict(known)) < len(known):
        raise Unprocessable("A parameter of the launch is there twice.")
    return dict(known)


def bind_otherwise(request: Request, services: Services, login: UnboundLogin, form: dict[str, str]) -> Response:
    """For a browser that kept no cookie in the frame: by the platform's storage, else in a new tab."""
    if login.storage and "key" not in form:
        return show_framed(
            request, "lti_storage.html", login.platform, origin=read_origin(login.platform.login_url),
            storage=login.storage, name=logins.make_name(form["state"]), form=form,
            address=make_login_url(services, request, login),
        )  # fmt: skip
    response = show_framed(request, "lti_tab.html", login.platform, address=make_login_url(services, request, login))
    response.status_code = 401
    return response


def make_login_url(services: Services, request: Request, login: UnboundLogin) -> str:
    """Says where the login begins again: in a new tab, cookies are kept."""
    return f"{logins.login_url(services.origin_of(request))}?{urlencode(login.fields)}"


def settle(request: Request, services: Services, launch: Launch, *, in_tab: bool) -> Response:
    """Records the launch, and answers it. `in_tab`: the frame keeps no cookies, so the work opens in a new tab. Raises
    Forbidden, NotFound."""
    arrival = services.sessions.writing(lambda session: arrive(services.database, session, launch))
    if arrival is None:
        raise Forbidden(NOT_APPROVED.format(launch.deployment_id))
    if arrival.member is None:
        if not launch.teaches or launch.subject is None:
            raise Forbidden(UNLINKED)
        return show_course_form(request, services, launch, arrival.context)
    library = services.content.get(arrival.member.course).library
    if launch.selection is not None:
        return show_choices(request, services, library, launch, arrival)
    address = make_address(library, arrival)
    if launch.reviewed is not None:
        reviewed = services.sessions.reading(lambda session: find_reviewed(session, launch, arrival))
        if arrival.role is Role.INSTRUCTOR:
            address = make_review_address(reviewed, arrival)
    if in_tab:
        return show_button(request, services, launch.platform, arrival, address)
    return enter(request, services, arrival.member, launch.platform.id, address=address)


def make_address(library: Library, arrival: Arrival) -> str:
    """Returns the page of a quiz, at the question. Raises NotFound if the content has it no more."""
    if arrival.quiz is None:
        return "/instructor" if arrival.role == "instructor" else "/"
    library.quiz(arrival.quiz)
    address = f"/?quiz={quote(arrival.quiz, safe='')}"
    if arrival.question is None:
        return address
    if kind_of(library.question(arrival.quiz, arrival.question)).is_script:
        return f"/quizzes/{quote(arrival.quiz, safe='')}/{quote(arrival.question, safe='')}"
    return f"{address}#{quote(arrival.quiz)}--{quote(arrival.question)}"


def make_review_address(member: str, arrival: Arrival) -> str:
    """Returns the page of a learner's answers and verdicts, at the question if there is one. Answers under review
    without a name are not on it."""
    address = f"/instructor/learners/{quote(member, safe='')}"
    if arrival.quiz is None or arrival.question is None:
        return address
    return f"{address}#{quote(arrival.quiz)}--{quote(arrival.question)}"


def name_cookie(services: Services, state: str) -> str:
    """The name of the cookie that binds a login to its browser: one for each, as a page may have several frames."""
    return f"{'__Host-' if services.sessions.secure else ''}{logins.make_name(state)}"


def make_key_cookie(services: Services, login: Login) -> str:
    """Returns the `Set-Cookie` header that binds a login to its browser."""
    attributes = services.sessions.attributes(int(logins.LIFETIME.total_seconds()), framed=True)
    return f"{name_cookie(services, login.state)}={login.key}; {attributes}"


router.routes.extend(launches.routes)
