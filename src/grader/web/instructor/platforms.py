"""`/instructor/lti`: learning platforms, and their courses that are linked with ours. It needs no script. Every
instructor sees the courses of platforms that are linked with the own course, or ask to be. Instructors of the course
`default` also administer the platforms."""

from typing import Any

from fastapi import Request
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import RedirectResponse, Response
from sqlalchemy.orm import Session

from grader.courses.people import platforms as rules
from grader.courses.people.identity import DEFAULT_COURSE, Identity
from grader.errors import CallerError
from grader.gate.late_routes import page_router
from grader.gate.services import AppServices, Services
from grader.platforms import administration
from grader.platforms.tool import MISSING, list_addresses
from grader.web.frame.inputs import Form, Instructor, RowId, Visitor
from grader.web.frame.rendering import PRIVATE, page
from grader.web.learner.pages import show_sign_in
from grader.web.platform.frames import LtiTool

PAGE = "/instructor/lti"

router = page_router()


@router.get(PAGE)
def show(request: Request, services: AppServices, who: Visitor) -> Response:
    """The platforms and their courses; to anyone but an instructor, how to sign in."""
    if who is None or not who.is_instructor:
        return show_sign_in(request, services, who)
    return render(request, services, who)


def render(request: Request, services: Services, who: Identity, status: int = 200, **more: Any) -> Response:
    """Renders the page as it is now, with the outcome of a form."""
    administers = who.course == DEFAULT_COURSE

    def listed(session: Session) -> dict[str, Any]:
        platforms = administration.list_platforms(session) if administers else []
        return {"platforms": platforms, "contexts": administration.list_contexts(session, who.course)}

    lists = services.sessions.reading(listed)
    tool = list_addresses(services.origin_of(request))
    trouble = None if services.tool is not None else MISSING
    context = {"trouble": trouble, "administers": administers, "tool": tool, "typed": {}, **lists, **more}
    return page(request, "platforms.html", status, PRIVATE, who=who, **context)


@router.post(f"{PAGE}/platforms")
def add(request: Request, services: AppServices, who: Instructor, form: Form) -> Response:
    """Registers a platform by hand; it waits for approval. Shows the page again if it is refused. Raises Unauthorized,
    Forbidden."""
    rules.require_administrator(who)
    try:
        given = administration.read_registration({**form, "origins": form.get("origins", "").split()})
        services.sessions.writing(lambda session: rules.add(session, who, given, form.get("deployment_id", "").strip()))
    except CallerError as error:
        return render(request, services, who, 422, trouble=str(error), typed=form)
    return RedirectResponse(PAGE, 303)


@router.post(f"{PAGE}/platforms/{{platform_id}}/approve")
def approve(platform_id: RowId, services: AppServices, who: Instructor) -> Response:
    """Approves a platform and the deployments that wait. Raises Unauthorized, Forbidden, NotFound."""
    rules.require_administrator(who)
    services.sessions.writing(lambda session: rules.approve(session, who, platform_id))
    return RedirectResponse(PAGE, 303)


@router.post(f"{PAGE}/platforms/{{platform_id}}/remove")
def remove(platform_id: RowId, services: AppServices, who: Instructor) -> Response:
    """Removes a platform. Raises Unauthorized, Forbidden, NotFound."""
    rules.require_administrator(who)
    services.sessions.writing(lambda session: rules.remove(session, who, platform_id))
    return RedirectResponse(PAGE, 303)


@router.post(f"{PAGE}/registration")
def registration(request: Request, services: AppServices, who: Instructor, _tool: LtiTool) -> Response:
    """Shows a single-use address for dynamic registration. Raises Unauthorized, Forbidden."""
    rules.require_administrator(who)
    origin = services.origin_of(request)
    link = services.sessions.writing(lambda session: administration.registration_link(session, origin))
    return render(request, services, who, link=link)


@router.post(f"{PAGE}/contexts/{{context_id}}/link")
def link(context_id: RowId, services: AppServices, who: Instructor) -> Response:
    """Links a platform's course that asks for it with the instructor's own. Raises Forbidden, NotFound."""
    services.sessions.writing(
        lambda session: rules.link(session, who, rules.get_own_context(session, who, context_id).id, who.course)
    )
    return RedirectResponse(PAGE, 303)


@router.post(f"{PAGE}/contexts/{{context_id}}/unlink")
def unlink(context_id: RowId, services: AppServices, who: Instructor) -> Response:
    """Ends or declines the link of a platform's course with the own one. Raises Forbidden, NotFound."""
    services.sessions.writing(
        lambda session: rules.unlink(session, who, rules.get_own_context(session, who, context_id).id)
    )
    return RedirectResponse(PAGE, 303)


@router.post(f"{PAGE}/contexts/{{context_id}}/roster")
async def roster(
    request: Request, context_id: RowId, services: AppServices, who: Instructor, tool: LtiTool
) -> Response:
    """Pulls the members of a platform's course into the own one, and tells how many. Raises Forbidden, NotFound."""
    try:
        pulled = await administration.pull_roster(services.database, tool.authorized, who, context_id)
    except CallerError as error:
        return await run_in_threadpool(render, request, services, who, 409, trouble=str(error))
    notice = f"{pulled.members} members; {pulled.removed} others whom an instructor had removed."
    return await run_in_threadpool(render, request, services, who, notice=notice)
