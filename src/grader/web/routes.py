"""The pages: `/` for learners, `/instructor`, and the files that they need."""

from pathlib import Path
from typing import Annotated, Any

from fastapi import APIRouter, Body, Depends, Request
from fastapi.responses import HTMLResponse, PlainTextResponse, Response
from fastapi.staticfiles import StaticFiles
from fastapi.templating import Jinja2Templates

from grader.errors import NotFound, TooLarge, Unauthorized
from grader.identity import Identity, Role, authenticate
from grader.library import Library
from grader.web.certificates import certificate_rows
from grader.web.page import page_of
from grader.web.prose import safe_html

ROOM = Path(__file__).parent
PROSE_BYTES_MAX = 64 * 1024
SIGN_IN = "Sign in first."

HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: https:; connect-src 'self'; "
        "form-action 'self'; base-uri 'none'; frame-ancestors 'self'"
    ),
    "Referrer-Policy": "same-origin",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "private, no-cache",
}
"""Scripts and styles are our own and never within the HTML; authors may show pictures from elsewhere."""

router = APIRouter(include_in_schema=False)
static_files = StaticFiles(directory=ROOM / "static")
templates = Jinja2Templates(directory=ROOM / "templates")
templates.env.trim_blocks = templates.env.lstrip_blocks = True


def library_of(request: Request) -> Library:
    """The content as it stands now."""
    library: Library = request.app.state.context.content.library
    return library


def visitor(request: Request) -> Identity | None:
    """Whose browser this is, if its session is known."""
    try:
        return authenticate(request.app.state.context.database, None, request.cookies)
    except Unauthorized:
        return None


Content = Annotated[Library, Depends(library_of)]
Visitor = Annotated[Identity | None, Depends(visitor)]


@router.get("/")
def student_page(request: Request, library: Content, who: Visitor, quiz: str | None = None) -> Response:
    """Every quiz, or the one that `?quiz=` names. On loopback whoever opens the page is let in with it."""
    if who is None and not request.app.state.doorstep.anonymous:
        return page(request, "signin.html", 401, who=None)
    chosen = library.quizzes.values() if quiz is None else [library.quiz(quiz)]
    return page(request, "student.html", who=who, quizzes=[page_of(library, one) for one in chosen])


@router.get("/instructor")
def instructor_page(request: Request, library: Content, who: Visitor) -> Response:
    """What is loaded, and what was handed in; for anybody else, how to sign in."""
    if who is None or not who.is_instructor:
        return page(request, "signin.html", 401 if who is None else 403, who=who)
    quizzes = [page_of(library, quiz) | {"digest": library.digest(quiz.id)} for quiz in library.quizzes.values()]
    return page(request, "instructor.html", who=who, quizzes=quizzes, warnings=list(map(str, library.warnings)))


@router.get("/instructor/certificates")
def certificates(request: Request, library: Content, who: Visitor) -> Response:
    """Every answer key held against physics now, as a part of the instructor page. Raises Unauthorized, Forbidden."""
    if who is None:
        raise Unauthorized(SIGN_IN)
    who.require(Role.INSTRUCTOR)
    return page(request, "certificates.html", rows=list(certificate_rows(library)))


@router.get("/quizzes/{quiz_id}/{question_id}/starter.py")
def starter(quiz_id: str, question_id: str, request: Request, library: Content, who: Visitor) -> Response:
    """The starter file of an exercise. Raises Unauthorized, NotFound."""
    if who is None and not request.app.state.doorstep.anonymous:
        raise Unauthorized(SIGN_IN)
    text = library.starter(library.question(quiz_id, question_id))
    if text is None:
        raise NotFound("This question has no starter file.")
    headers = {"Content-Disposition": f'attachment; filename="{question_id}.py"'}
    return PlainTextResponse(text, headers=HEADERS | headers, media_type="text/x-python")


@router.post("/prose")
def render_prose(body: Annotated[bytes, Body(media_type="text/plain")], who: Visitor) -> Response:
    """An author's HTML with TeX, as a verdict brings it, made safe to show. Raises Unauthorized, TooLarge."""
    if who is None:
        raise Unauthorized(SIGN_IN)
    if len(body) > PROSE_BYTES_MAX:
        raise TooLarge(f"At most {PROSE_BYTES_MAX // 1024} KB of prose are taken.")
    return HTMLResponse(safe_html(body.decode(errors="replace")), headers=HEADERS)


@router.get("/favicon.ico")
async def favicon(request: Request) -> Response:
    """The icon, for pages that do not name it."""
    return await static_file("icon.svg", request)


@router.get("/static/{path:path}")
async def static_file(path: str, request: Request) -> Response:
    """Style and scripts; a browser asks each time whether they have changed."""
    response = await static_files.get_response(path, request.scope)
    response.headers.update({"Cache-Control": "no-cache", "X-Content-Type-Options": "nosniff"})
    return response


def page(request: Request, template: str, status: int = 200, **context: Any) -> Response:
    """A page with the headers that every page has."""
    return templates.TemplateResponse(request, template, context, status_code=status, headers=HEADERS)
