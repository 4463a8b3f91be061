"""`/session` begins a session on loopback, `/signin` exchanges a single-use code for one, `/join` a course's code.
`/signout` ends it. A GET changes nothing and stores nothing: mail programs and link scanners open links on their
own."""

from urllib.parse import urlencode

from fastapi import Request
from fastapi.responses import JSONResponse, RedirectResponse, Response

from grader.courses.people.courses import add_course
from grader.courses.people.identity import Identity
from grader.courses.people.invitations import CLOSED, join
from grader.courses.people.sign_in import (
    SPENT,
    BrowserSession,
    create_return_code,
    find_identity,
    is_only_in_browser,
    redeem_sign_in_code,
    start_anonymous_session,
)
from grader.errors import Forbidden, Unauthorized
from grader.gate.late_routes import page_router
from grader.gate.services import AppServices
from grader.store.courses import course_with_code
from grader.web.frame.inputs import Form, Visitor
from grader.web.frame.rendering import PRIVATE, page

router = page_router()


@router.post("/session")
def begin(request: Request, services: AppServices, who: Visitor, form: Form) -> Response:
    """Begins an anonymous session on loopback, unless the browser has one. Raises Forbidden. The page's script gets the
    learner as JSON, a form is redirected to the questions, or to the device whose code it names."""
    if not services.sessions.anonymous:
        raise Forbidden("Open the link that you were given to sign in.")
    headers = {"Cache-Control": "no-store"}
    if who is None:
        opened = services.sessions.writing(start_anonymous_session)
        who = opened.identity
        headers["Set-Cookie"] = services.sessions.set_cookie(opened)
    if "application/json" in request.headers.get("accept", ""):
        return JSONResponse({"id": who.id, "user": who.user}, headers=headers)
    code = form.get("code")
    address = f"/devices?{urlencode({'code': code})}" if code else "/"
    return RedirectResponse(address, 303, headers)


@router.get("/signin")
def show_sign_in(request: Request, services: AppServices, who: Visitor, code: str = "") -> Response:
    """Shows who the code signs in, and a button. The code is used by POST alone."""
    invited = services.sessions.reading(lambda session: find_identity(session, code))
    if invited is None:
        return show_spent(request, services, who)
    adds = who is not None and who.is_instructor and invited.is_instructor and who.course != invited.course
    return page(request, "confirm.html", 200, PRIVATE, who=who, invited=invited, code=code, adds=adds)


def show_spent(request: Request, services: AppServices, who: Identity | None) -> Response:
    """Says that a link signs nobody in any more, and every way on that there is."""
    ways = {"oidc": services.provider is not None, "begin": services.sessions.anonymous}
    return page(request, "signin.html", 401, PRIVATE, who=who, trouble=SPENT, **ways)


@router.post("/signin")
def sign_in(request: Request, services: AppServices, who: Visitor, form: Form) -> Response:
    """Uses the code, ends the browser's earlier session, and redirects to the page of the user's role. With `add` the
    course is added to those of the instructor who is signed in, whose session goes on behind the new one. A code that
    was used meanwhile, as by a second click, shows the ways on. Raises Forbidden, Conflict."""
    code = form.get("code", "")
    if who is not None and "add" in form:
        entered = services.sessions.writing(lambda session: add_course(session, who, code))
        headers = {"Set-Cookie": services.sessions.set_cookie(entered), "Cache-Control": "no-store"}
        return RedirectResponse("/instructor", 303, headers)
    try:
        opened = services.sessions.writing(lambda session: redeem_sign_in_code(session, code))
    except Unauthorized:
        return show_spent(request, services, who)
    return redirect_signed_in(request, services, opened)


def redirect_signed_in(request: Request, services: AppServices, opened: BrowserSession) -> Response:
    """Ends the browser's earlier session, and redirects to the page of the user's role with the new one's cookie."""
    services.sessions.end(request.cookies)
    headers = {"Set-Cookie": services.sessions.set_cookie(opened), "Cache-Control": "no-store"}
    return RedirectResponse("/instructor" if opened.identity.is_instructor else "/", 303, headers)


@router.get("/join")
def show_join(request: Request, services: AppServices, who: Visitor, code: str = "") -> Response:
    """A form for the name of a learner who comes with a course link."""
    course = services.sessions.reading(lambda session: course_with_code(session, code))
    if course is None:
        return page(request, "signin.html", 403, PRIVATE, who=who, trouble=CLOSED)
    return page(request, "join.html", 200, PRIVATE, who=who, course=course, code=code)


@router.post("/join")
def join_course(services: AppServices, form: Form, request: Request) -> Response:
    """Makes a new learner of the course, and redirects to the questions. Raises Forbidden, Unprocessable."""
    code, name = form.get("code", ""), form.get("name", "")
    opened = services.sessions.writing(lambda session: join(session, code, name))
    return redirect_signed_in(request, services, opened)


@router.get("/signout")
def show_sign_out(request: Request, services: AppServices, who: Visitor) -> Response:
    """Shows what signing out loses, and two buttons: one makes a link to come back, one signs out."""
    if who is None:
        return RedirectResponse("/", 303)
    only_here = services.sessions.reading(lambda session: is_only_in_browser(session, who))
    return page(request, "signout.html", who=who, only_here=only_here)


@router.post("/signout/link")
def make_return_link(request: Request, services: AppServices, who: Visitor) -> Response:
    """Shows a single-use link with which the learner comes back; it replaces an earlier one. Raises Unauthorized."""
    if who is None:
        raise Unauthorized("Sign in first.")
    code = services.sessions.writing(lambda session: create_return_code(session, who))
    link = f"{services.origin_of(request)}/signin?code={code}"
    return page(request, "signout.html", 200, PRIVATE, who=who, link=link)


@router.post("/signout")
def sign_out(request: Request, services: AppServices, who: Visitor) -> Response:
    """Ends the session."""
    services.sessions.end(request.cookies)
    response = RedirectResponse("/", 303, {"Set-Cookie": services.sessions.delete_cookie()})
    if who is not None and who.platform is not None:
        response.headers.append("Set-Cookie", services.sessions.delete_cookie(framed=True))
    return response
