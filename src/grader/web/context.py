"""Gives pages the app's objects and the user of the browser."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated
from urllib.parse import parse_qs

from fastapi import Depends, Path, Request
from fastapi.concurrency import run_in_threadpool
from sqlalchemy.orm import Session

from grader.content import Contents
from grader.courses.desk import Desk
from grader.courses.handing_in import Answer
from grader.courses.measuring import Statistics
from grader.courses.pseudonyms import Blinding
from grader.errors import Unauthorized, Unprocessable
from grader.identity import DEFAULT_COURSE, Identity, Role
from grader.library import Library
from grader.lms.tool import Tool
from grader.pipeline import Pipeline
from grader.store.database import Database
from grader.store.tables import ROW_ID_MAX
from grader.store.writer import Writer
from grader.web.provider import Provider
from grader.web.sessions import SessionCookies

FIELDS_MAX = 1000
"""Fields of a form: a box for each learner of a large course."""

RowId = Annotated[int, Path(ge=1, le=ROW_ID_MAX)]
"""The number of a row, in a path."""


@dataclass(frozen=True)
class PageContext:
    """The objects that all pages of an app share."""

    content: Contents
    sessions: SessionCookies
    public_origin: str | None
    provider: Provider | None
    tool: Tool | None
    """The LTI tool; None without the packages of the extra `lti`."""
    writer: Writer[Answer]
    queue_per_user: int
    blinding: Blinding
    workers_alive: Callable[[Session], int]
    """Tells how many workers of the database live."""
    statistics: Statistics
    """Those of the API."""

    def desk_of(self, course: str) -> Desk:
        """What reviewing in a course works with, on its content as it is now."""
        return Desk(self.database, self.content.of(course).library, self.blinding)

    def pipeline_for(self, who: Identity) -> Pipeline:
        """What reads and grades the answers of a user's course."""
        return self.content.of(who.course).pipeline

    def library_for(self, who: Identity | None) -> Library:
        """The content that is loaded now for a user's course; for a browser without a session, of the default one."""
        return self.content.of(DEFAULT_COURSE if who is None else who.course).library

    @property
    def database(self) -> Database:
        """The database of the sessions, and of everything else."""
        return self.sessions.database

    def origin_of(self, request: Request) -> str:
        """The origin under which the browser reached the service; its host was checked by AdmissionMiddleware."""
        return self.public_origin or str(request.base_url).rstrip("/")


async def page_context_of(request: Request) -> PageContext:
    """The context of the app that serves a request, typed: the only place that looks it up."""
    context: PageContext = request.app.state.pages
    return context


Pages = Annotated[PageContext, Depends(page_context_of)]


async def visitor_of(request: Request) -> Identity | None:
    """The user of the browser, whom the middleware has identified; None without a valid session."""
    identity: Identity | None = request.state.identity
    return identity


Visitor = Annotated[Identity | None, Depends(visitor_of)]


def instructor(who: Identity | None) -> Identity:
    """The instructor of the browser. Raises Unauthorized, Forbidden."""
    if who is None:
        raise Unauthorized("Sign in first.")
    who.require(Role.INSTRUCTOR)
    return who


async def form_of(request: Request) -> dict[str, str]:
    """The fields of a form that the browser sent; of a repeated field, the first."""
    return await run_in_threadpool(parsed_form, await request.body())


def parsed_form(body: bytes) -> dict[str, str]:
    """The fields of a form as it is sent. Raises Unprocessable for more fields than a page has."""
    try:
        fields = parse_qs(body.decode(errors="replace"), keep_blank_values=True, max_num_fields=FIELDS_MAX)
    except ValueError as error:
        raise Unprocessable(f"A form has at most {FIELDS_MAX} fields.") from error
    return {name: values[0] for name, values in fields.items()}


Form = Annotated[dict[str, str], Depends(form_of)]
