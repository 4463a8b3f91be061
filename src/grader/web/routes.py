"""The pages: `/` for learners, `/instructor`, and their files."""

from typing import Annotated, Any

from fastapi import APIRouter, Body, Request
from fastapi.responses import HTMLResponse, PlainTextResponse, Response
from fastapi.staticfiles import StaticFiles

from grader.courses.policy import before_opening
from grader.courses.standing import Standing, require_opened, standing_of
from grader.domain.quiz import Quiz
from grader.errors import NotFound, Unauthorized
from grader.identity import DEFAULT_COURSE, Identity, Role, Scope
from grader.library import Library
from grader.web import oidc, regrades, signin
from grader.web.certificates import certificate_rows
from grader.web.context import Pages, Visitor
from grader.web.page import page_of, unopened_page
from grader.web.prose import safe_html
from grader.web.rendering import HEADERS, ROOM, page

SIGN_IN = "Sign in first."

router = APIRouter(include_in_schema=False)
router.include_router(signin.router)
router.include_router(oidc.router)
router.include_router(regrades.router)
static_files = StaticFiles(directory=ROOM / "static")


@router.get("/")
def student_page(request: Request, pages: Pages, who: Visitor, quiz: str | None = None) -> Response:
    """Every quiz, or the one that `?quiz=` names. On loopback anyone may read; the first answer begins a session."""
    if who is None and not pages.sessions.anonymous:
        return page(request, "signin.html", 401, who=None, oidc=pages.provider is not None)
    library = pages.library_for(who)
    chosen = library.quizzes.values() if quiz is None else [library.quiz(quiz)]
    reader = who or Identity("", "", Role.STUDENT, DEFAULT_COURSE)  # a browser whose session has not begun
    with pages.database.read() as session:
        standing = standing_of(session, library, reader)
    shown = [quiz_page(library, standing, one) for one in chosen]
    return page(request, "student.html", who=who, begin=who is None, quizzes=shown)


def quiz_page(library: Library, standing: Standing, quiz: Quiz) -> dict[str, Any]:
    """A quiz as this learner may see it now."""
    if not standing.has_opened(quiz.id):
        return unopened_page(quiz, before_opening(quiz.policy, standing.at) or "")
    return page_of(library, quiz, {question.id: standing.notice(quiz, question) for question in quiz.questions})


@router.get("/instructor")
def instructor_page(request: Request, pages: Pages, who: Visitor) -> Response:
    """Shows content and submissions to an instructor, and the sign-in page to others."""
    if who is None or not who.is_instructor:
        return page(request, "signin.html", 401 if who is None else 403, who=who, oidc=pages.provider is not None)
    library = pages.library_for(who)
    quizzes = [page_of(library, quiz) | {"digest": library.digest(quiz.id)} for quiz in library.quizzes.values()]
    return page(request, "instructor.html", who=who, quizzes=quizzes, warnings=list(map(str, library.warnings)))


@router.get("/instructor/people")
def people_page(request: Request, pages: Pages, who: Visitor) -> Response:
    """Members, invitations, tokens, the course link and the audit log; the page's script fills them in."""
    if who is None or not who.is_instructor:
        return page(request, "signin.html", 401 if who is None else 403, who=who, oidc=pages.provider is not None)
    return page(request, "people.html", who=who, roles=list(Role), scopes=list(Scope))


@router.get("/instructor/certificates")
def certificates(request: Request, pages: Pages, who: Visitor) -> Response:
    """Re-derives every answer key, as a part of the instructor page. Raises Unauthorized, Forbidden."""
    if who is None:
        raise Unauthorized(SIGN_IN)
    who.require(Role.INSTRUCTOR)
    return page(request, "certificates.html", rows=certificate_rows(pages.library_for(who)))


@router.get("/quizzes/{quiz_id}/{question_id}/starter.py")
def starter(quiz_id: str, question_id: str, pages: Pages, who: Visitor) -> Response:
    """The starter file of an exercise. Raises Unauthorized, NotFound, and Conflict before the quiz opens."""
    if who is None and not pages.sessions.anonymous:
        raise Unauthorized(SIGN_IN)
    library = pages.library_for(who)
    require_opened(library, quiz_id, Role.STUDENT if who is None else who.role)
    text = library.starter(library.question(quiz_id, question_id))
    if text is None:
        raise NotFound("This question has no starter file.")
    headers = {"Content-Disposition": f'attachment; filename="{question_id}.py"'}
    return PlainTextResponse(text, headers=HEADERS | headers, media_type="text/x-python")


@router.post("/prose")
def render_prose(body: Annotated[bytes, Body(media_type="text/plain")], who: Visitor) -> Response:
    """Sanitises an author's HTML with TeX, such as a verdict's explanation. Raises Unauthorized."""
    if who is None:
        raise Unauthorized(SIGN_IN)
    return HTMLResponse(safe_html(body.decode(errors="replace")), headers=HEADERS)


@router.get("/favicon.ico")
async def favicon(request: Request) -> Response:
    """The icon, at the address where browsers look for it."""
    return await static_file("icon.svg", request)


@router.get("/static/{path:path}")
async def static_file(path: str, request: Request) -> Response:
    """Styles and scripts; a browser revalidates them on every use."""
    response = await static_files.get_response(path, request.scope)
    response.headers.update({"Cache-Control": "no-cache", "X-Content-Type-Options": "nosniff"})
    return response
