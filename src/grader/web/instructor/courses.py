"""`/instructor/courses`: the courses that this person teaches, a button to enter each, and a form that makes one. It
needs no script."""

from typing import Any

from fastapi import Request
from fastapi.responses import RedirectResponse, Response
from sqlalchemy.orm import Session

from grader.courses.people import courses
from grader.courses.people.identity import DEFAULT_COURSE, Identity
from grader.errors import Conflict, Unprocessable
from grader.gate.late_routes import page_router
from grader.gate.services import AppServices, Services
from grader.web.frame.inputs import Form, Instructor, Visitor
from grader.web.frame.rendering import PRIVATE, page
from grader.web.learner.pages import show_sign_in
from grader.web.platform.frames import start_session_in

PAGE = "/instructor/courses"

router = page_router()


@router.get(PAGE)
def show(request: Request, services: AppServices, who: Visitor) -> Response:
    """The courses that this person teaches; to anyone but an instructor, how to sign in."""
    if who is None or not who.is_instructor:
        return show_sign_in(request, services, who)
    return render(request, services, who)


def render(request: Request, services: Services, who: Identity, status: int = 200, **more: Any) -> Response:
    """Renders the page as it is now, with the outcome of a form: what was `typed`, and the `trouble`."""
    folders = sorted(services.content.libraries())

    def listed(session: Session) -> dict[str, Any]:
        return {"taught": courses.list_taught(session, who), "unused": courses.list_unused(session, folders)}

    lists = services.sessions.reading(listed)
    quizzes = {taught.course: len(services.content.get(taught.course).library.quizzes) for taught in lists["taught"]}
    context = {"administers": who.course == DEFAULT_COURSE, "folders": folders, "quizzes": quizzes, "typed": ""}
    return page(request, "courses.html", status, PRIVATE, who=who, **{**context, **lists, **more})


@router.post(PAGE)
def make(request: Request, services: AppServices, who: Instructor, form: Form) -> Response:
    """Makes a course, whose instructor this person becomes; shows the page again if it is refused. Raises Unauthorized,
    Forbidden."""
    name = form.get("name", "")
    try:
        with services.database.write() as session:
            courses.make_course(services.database, session, who, name)
    except (Conflict, Unprocessable) as error:
        status = 409 if isinstance(error, Conflict) else 422
        return render(request, services, who, status, typed=name, trouble=str(error))
    return RedirectResponse(PAGE, 303)


@router.post(f"{PAGE}/{{member_id}}/enter")
def enter(request: Request, member_id: str, services: AppServices, who: Instructor) -> Response:
    """Opens a session in another course of this person, as the member who they are there. Raises Unauthorized,
    Forbidden, NotFound."""
    opened = services.sessions.writing(lambda session: courses.enter_course(session, who, member_id))
    response = RedirectResponse("/instructor", 303, {"Cache-Control": "no-store"})
    if who.platform is not None:
        return start_session_in(request, services, response, opened)
    response.headers.append("Set-Cookie", services.sessions.set_cookie(opened))
    return response
