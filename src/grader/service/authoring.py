"""The server of `grader author`: one folder, one author, on this machine alone."""

from pathlib import Path
from typing import Any

import uvicorn
from fastapi import APIRouter, FastAPI
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response
from starlette.types import ASGIApp, Receive, Scope, Send

from grader.api.learning.labs import LabBody, find_lab, record
from grader.domain.pages.media import ADDRESS
from grader.errors import CallerError, NotFound
from grader.library import Library, PassedChecks
from grader.library.media import read_media
from grader.questions import kind_of, lab_view, student_view
from grader.web.author import pages
from grader.web.author.desk import AuthorDesk, OpenPipeline
from grader.web.frame import assets
from grader.web.frame.rendering import keep_compiled
from grader.web.learner.media import send_media

HOST = "127.0.0.1"
HOSTS = [HOST, "localhost"]
"""The names that a browser on this machine may use: another name would be another site that leads here."""


labs = APIRouter()
"""What the labs of a page ask for, at the addresses of the service's own API."""


@labs.post("/session")
def begin_session() -> dict[str, str]:
    """Names the author, as the scripts of a page demand it."""
    return {"id": "author", "user": "author"}


@labs.get("/api/v1/quizzes/{quiz}")
def get_quiz(quiz: str, request: Request) -> dict[str, Any]:
    """The student's view of a quiz, with every lab. Raises NotFound."""
    loaded = load_quiz(request, quiz).quiz(quiz)
    shown = student_view(loaded, loaded.default_policy)
    for view, question in zip(shown["questions"], loaded.questions, strict=True):
        lab = kind_of(question).lab(question)
        if lab is not None:
            view["lab"] = lab_view(lab)
    return shown


@labs.post("/api/v1/labs:run")
def run_lab(body: LabBody, request: Request) -> Response:
    """Runs a lab. Raises NotFound, Unprocessable."""
    library = load_quiz(request, body.quiz)
    packed = record(library, find_lab(library, body), body).packed
    return Response(packed, media_type="application/json", headers={"Content-Encoding": "gzip"})


def load_quiz(request: Request, quiz: str) -> Library:
    """Returns the content as it is now. Raises NotFound while it has faults."""
    desk: AuthorDesk = request.app.state.desk
    library = desk.load(quiz)
    if not isinstance(library, Library):
        raise NotFound("The content has faults: mend them first.")
    return library


class SameOrigin:
    """Refuses what a page of another site sends: it could write into the folder."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Lets reading pass, and what was sent from a page of this server."""
        if scope["type"] == "http" and scope["method"] not in ("GET", "HEAD"):
            request = Request(scope)
            origin = request.headers.get("origin")
            if origin is None or origin.partition("://")[2] != request.headers.get("host"):
                await PlainTextResponse("This request comes from another site.", 403)(scope, receive, send)
                return
        await self.app(scope, receive, send)


def make_app(root: Path, passed: PassedChecks, open_pipeline: OpenPipeline) -> FastAPI:
    """Makes the app of an author's desk. Nothing of it is known to the service for learners."""
    app = FastAPI(openapi_url=None, docs_url=None, redoc_url=None)
    keep_compiled(passed.place)
    app.state.desk = AuthorDesk(root, passed, open_pipeline)
    app.add_middleware(SameOrigin)
    app.add_middleware(TrustedHostMiddleware, allowed_hosts=HOSTS)
    app.include_router(pages.router)
    app.include_router(labs)
    app.add_exception_handler(CallerError, pages.refuse)

    @app.get(ADDRESS + "{sha256}/{name}")
    def show_media(sha256: str, name: str) -> Response:
        """A picture or file of the folder as it is now. Raises NotFound."""
        for file in read_media(root)[0].values():
            if (file.sha256, file.name) == (sha256, name):
                return send_media(file)
        raise NotFound("There is no such picture or file.")

    @app.get("/static/{path:path}")
    async def static_file(path: str, request: Request) -> Response:
        return await assets.static_file(path, request.scope)

    return app


def serve_author(root: Path, passed: PassedChecks, open_pipeline: OpenPipeline, port: int) -> None:
    """Serves the desk on loopback until it is interrupted."""
    uvicorn.run(make_app(root, passed, open_pipeline), host=HOST, port=port, log_level="warning")
