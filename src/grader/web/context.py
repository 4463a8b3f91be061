"""Gives pages the app's objects and the user of the browser."""

from dataclasses import dataclass
from typing import Annotated
from urllib.parse import parse_qs

from fastapi import Depends, Request

from grader.content import Contents
from grader.identity import DEFAULT_COURSE, Identity
from grader.library import Library
from grader.store.database import Database
from grader.web.provider import Provider
from grader.web.sessions import SessionCookies


@dataclass(frozen=True)
class PageContext:
    """The objects that all pages of an app share."""

    content: Contents
    sessions: SessionCookies
    public_origin: str | None
    provider: Provider | None = None

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


async def form_of(request: Request) -> dict[str, str]:
    """The fields of a form that the browser sent; of a repeated field, the first."""
    fields = parse_qs((await request.body()).decode(errors="replace"))
    return {name: values[0] for name, values in fields.items()}


Form = Annotated[dict[str, str], Depends(form_of)]
