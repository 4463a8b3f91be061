"""The forms that follow a launch: which course, which quizzes, a new tab; and a platform's registration. Each bears a
single-use ticket, as a frame may keep no cookies. The ticket says who was shown the form."""

from collections.abc import Mapping
from datetime import timedelta
from typing import Any

import structlog
from fastapi import Request
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import RedirectResponse, Response
from sqlalchemy.orm import Session

from grader.courses.answering.policies import read_policies
from grader.courses.people import platforms as rules
from grader.courses.people.audit import Action, record
from grader.courses.people.identity import Role
from grader.courses.people.sign_in import start_session
from grader.domain.platform import Platform
from grader.domain.policy import Policy
from grader.errors import Forbidden, NotFound, Unauthorized, Unprocessable
from grader.gate.late_routes import page_router
from grader.gate.services import AppServices, Services
from grader.library import Library
from grader.platforms.launching.addresses import read_origin
from grader.platforms.launching.arrival import Arrival
from grader.platforms.launching.deep_linking import CHOICES_MAX, Choice, sign_response
from grader.platforms.launching.launch import ContentSelection, Launch
from grader.platforms.launching.login import launch_url
from grader.platforms.launching.registration import PURPOSE as REGISTRATION
from grader.platforms.launching.registration import UNUSABLE, fetch_offer, register
from grader.store import platforms, tickets
from grader.store.platforms import Context
from grader.store.tables import Member
from grader.web.frame.rendering import POLICY, PRIVATE, page, security_policy
from grader.web.platform.frames import LtiTool, Pairs, PlainWords, show_framed, start_session_in
from grader.web.text.questions import describe_quiz

log = structlog.get_logger()

router = page_router("/lti", route_class=PlainWords)

COURSE, CHOICE, TAB = "lti-course", "lti-choice", "lti-tab"
LIFETIME = timedelta(hours=1)
NO_LINK = "This registration link is unknown, used or too old. `grader lti register-link` makes one."
NO_CONFIGURATION = (
    "The address does not say where the platform's configuration is: it has no openid_configuration. Give the "
    "registration link to the platform, which opens it with that."
)
STALE = "This form was sent already, or is too old. Start again from your learning platform."


def take_ticket(session: Session, purpose: str, pairs: Pairs) -> dict[str, Any]:
    """Says what the form's ticket says; it is used up. Raises Unauthorized."""
    body = tickets.take(session, purpose, dict(pairs).get("ticket", ""))
    if body is None:
        raise Unauthorized(STALE)
    return body


def issue_ticket(services: Services, purpose: str, body: dict[str, Any]) -> str:
    """Returns a ticket for a form."""
    return services.sessions.writing(lambda session: tickets.issue(session, purpose, body, LIFETIME))


def show_course_form(request: Request, services: Services, launch: Launch, context: Context) -> Response:
    """Renders the form with which an instructor of the platform's course links it with a course here."""
    body = {"context": context.id, "by": launch.name, "platform": launch.platform.id}
    return show_framed(
        request, "lti_course.html", launch.platform, ticket=issue_ticket(services, COURSE, body), title=context.title,
        wanted=context.wanted or "",
    )  # fmt: skip


@router.post("/course")
def link_course(request: Request, services: AppServices, pairs: Pairs) -> Response:
    """Links the platform's course with a new course, or asks the instructors of an existing one."""
    course = dict(pairs).get("course", "").strip()
    with services.database.write() as session:
        body = take_ticket(session, COURSE, pairs)
        services.database.lock(session, rules.NEW_COURSES)  # of two who name the same one, one asks the other
        known = services.content.libraries()
        is_linked = rules.ask_for(session, body["context"], course, body["by"], known)
        platform = get_platform(session, body["platform"])
    return show_framed(request, "lti_linked.html", platform, course=course, is_linked=is_linked)


def show_choices(request: Request, services: Services, library: Library, launch: Launch, arrival: Arrival) -> Response:
    """Renders the form with which an instructor chooses quizzes and questions. Raises Forbidden for anybody else."""
    if arrival.role is not Role.INSTRUCTOR or arrival.member is None or launch.selection is None:
        raise Forbidden("Only an instructor of the course chooses what its links lead to.")
    body = {
        "platform": launch.platform.id, "deployment": launch.deployment_id, "course": arrival.member.course,
        "selection": vars(launch.selection),
    }  # fmt: skip
    quizzes = [describe_quiz(library, quiz) for quiz in library.list_asking()]
    return show_framed(
        request, "lti_choose.html", launch.platform, ticket=issue_ticket(services, CHOICE, body),
        quizzes=quizzes, course=arrival.member.course, takes_many=launch.selection.takes_many,
    )  # fmt: skip


@router.post("/choose")
def choose(request: Request, tool: LtiTool, services: AppServices, pairs: Pairs) -> Response:
    """Signs what the instructor chose, and lets the browser carry it to the platform."""
    with services.database.write() as session:
        body = take_ticket(session, CHOICE, pairs)
        platform = get_platform(session, body["platform"])
    selection = ContentSelection(**body["selection"])
    library = services.content.get(body["course"]).library
    with services.database.read() as session:
        policies = read_policies(session, library, body["course"], library.quizzes)
    choices = [parse_choice(library, policies, value) for name, value in pairs if name == "item"]
    if len(choices) > (CHOICES_MAX if selection.takes_many else 1):
        raise Unprocessable("More was chosen than the platform takes at once.")
    url = launch_url(services.origin_of(request))
    token = sign_response(tool.keys.sign, platform, body["deployment"], selection, choices=choices, launch_url=url)
    goes_to = (read_origin(selection.return_url), *platform.origins)
    return show_framed(
        request, "lti_return.html", platform, goes_to, address=selection.return_url, token=token, count=len(choices)
    )


def parse_choice(library: Library, policies: Mapping[str, Policy], value: str) -> Choice:
    """Returns the quiz, or the question after a slash, that a box of the form selects. Raises NotFound."""
    quiz_id, _, question_id = value.partition("/")
    quiz = library.quiz(quiz_id)
    return Choice(quiz, policies[quiz.id], library.question(quiz_id, question_id) if question_id else None)


def show_button(request: Request, services: Services, platform: Platform, arrival: Arrival, address: str) -> Response:
    """Renders the button that opens the work in a new tab, where cookies are kept."""
    assert arrival.member is not None
    body = {"member": arrival.member.id, "platform": platform.id, "address": address}
    return show_framed(request, "lti_open.html", platform, ticket=issue_ticket(services, TAB, body))


@router.post("/open")
def open_tab(request: Request, services: AppServices, pairs: Pairs) -> Response:
    """Opens a session in the new tab, and leads to the work."""
    with services.database.write() as session:
        body = take_ticket(session, TAB, pairs)
        member = session.get(Member, body["member"])
        if member is None or member.removed_at is not None:
            raise Forbidden("You were removed from this course. Ask its instructor.")
    return enter(request, services, member, body["platform"], address=body["address"])


def enter(request: Request, services: Services, member: Member, platform_id: int, *, address: str) -> Response:
    """Renders the redirect to the work, in a new session of the member; the browser's earlier one ends."""
    with services.database.write() as session:
        services.sessions.end_in(session, request.cookies)
        member = session.get_one(Member, member.id)  # as it is now: it may have lost its role since the launch
        opened = start_session(session, member, platform_id)
        record(session, opened.identity, member.course, Action.SIGNED_IN, member.name, by="lti")
    return start_session_in(request, services, RedirectResponse(address, 303, {"Cache-Control": "no-store"}), opened)


@router.get("/register")
def show_registration(
    request: Request, _tool: LtiTool, services: AppServices, token: str = "", openid_configuration: str = "",
    registration_token: str = "",
) -> Response:  # fmt: skip
    """Asks a platform's administrator, who came with a registration link, before anything is registered."""
    require_link(services, token)
    if not openid_configuration:
        raise Unprocessable(NO_CONFIGURATION)
    origin = read_origin(openid_configuration)
    if not origin:
        raise Unprocessable(UNUSABLE)
    headers = PRIVATE | {POLICY: security_policy([origin])}
    fields = {"token": token, "openid_configuration": openid_configuration, "registration_token": registration_token}
    return page(request, "lti_register.html", 200, headers, platform_origin=origin, fields=fields)


@router.post("/register")
async def do_register(request: Request, tool: LtiTool, services: AppServices, pairs: Pairs) -> Response:
    """Registers this tool at the platform, and the platform here, where it waits for approval. The link is used up when
    the platform is asked to register: what fails before may be tried again."""
    form = dict(pairs)
    url, token = form.get("openid_configuration", ""), form.get("token", "")
    await run_in_threadpool(require_link, services, token)
    try:
        offer = await fetch_offer(tool.requester, url, form.get("registration_token", ""))
        await run_in_threadpool(use_link, services, token)
        registered = await register(tool.requester, offer, services.origin_of(request))
    except Unprocessable as error:
        log.warning("a registration was refused", platform=read_origin(url), why=str(error))
        raise
    row = await run_in_threadpool(
        services.sessions.writing,
        lambda session: rules.add(session, None, registered.registration, registered.deployment_id),
    )
    headers = PRIVATE | {POLICY: security_policy([read_origin(url)])}
    return page(request, "lti_registered.html", 200, headers, platform=row)


def require_link(services: Services, token: str) -> None:
    """Raises Unauthorized unless this is the token of a registration link that may still be used."""
    if not services.sessions.reading(lambda session: tickets.peek(session, REGISTRATION, token) is not None):
        raise Unauthorized(NO_LINK)


def use_link(services: Services, token: str) -> None:
    """Uses up a registration link. Raises Unauthorized if somebody has done so meanwhile."""
    if services.sessions.writing(lambda session: tickets.take(session, REGISTRATION, token)) is None:
        raise Unauthorized(NO_LINK)


def get_platform(session: Session, platform_id: int) -> Platform:
    """Returns the platform with this id. Raises NotFound if it was removed meanwhile."""
    row = platforms.get(session, platform_id)
    if row is None:
        raise NotFound("The platform was removed.")
    return platforms.read_platform(row)
