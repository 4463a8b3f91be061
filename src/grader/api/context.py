"""What the JSON routes work with: the app's objects, and the identity of the caller."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Annotated

from fastapi import Depends, FastAPI, Header, Request, Security
from fastapi.security import HTTPBearer
from pydantic import SecretStr

from grader.api.admission import identity_in
from grader.api.lab_runs import LabRuns
from grader.api.rate import RateLimit
from grader.api.readiness import Readiness
from grader.api.streams import Streams
from grader.content import Contents
from grader.courses.desk import Desk
from grader.courses.gradebook import SheetLines
from grader.courses.handing_in import Answer
from grader.courses.kept import Kept, Parts
from grader.courses.measuring import Statistics
from grader.courses.pseudonyms import Blinding
from grader.identity import Identity, Role
from grader.lms.tool import Tool
from grader.store.database import Database
from grader.store.writer import Writer

GRADEBOOKS_KEPT = 8
"""Gradebooks that are kept: two megabytes for 5,000 learners and 8 questions."""


@dataclass(frozen=True)
class Context:
    """What one app's routes share."""

    database: Database
    content: Contents
    queue_per_user: int
    labs: LabRuns
    writer: Writer[Answer]
    blinding: Blinding
    readiness: Readiness
    by_user: RateLimit
    """What requests with a token or session are counted by. For the event loop."""
    exposition: Callable[[], bytes]
    """Makes the document of /metrics."""
    metrics_token: SecretStr | None = None
    public_origin: str | None = None
    """Where browsers reach the service; None on loopback."""
    private_hosts: tuple[str, ...] = ()
    """Hosts of webhooks that are allowed although they are not public."""
    tool: Tool | None = None
    """The LTI tool; None without the packages of the extra `lti`."""
    gradebooks: Kept[str, bytes] = field(default_factory=lambda: Kept(GRADEBOOKS_KEPT))
    """By ETag."""
    gradebook_lines: SheetLines = field(default_factory=lambda: Parts(GRADEBOOKS_KEPT))
    statistics: Statistics = field(default_factory=Statistics)
    streams: Streams = field(default_factory=Streams)

    def desk_of(self, course: str) -> Desk:
        """What reviewing in a course works with, on its content as it is now."""
        return Desk(self.database, self.content.of(course).library, self.blinding)


def context_in(app: FastAPI) -> Context:
    """The context of an app, typed: the only place that looks it up."""
    context: Context = app.state.context
    return context


async def context_of(request: Request) -> Context:
    """The context of the app that serves a request."""
    return context_in(request.app)


async def anybody(request: Request) -> Identity:
    """The caller, in any role."""
    return identity_in(request.scope)


async def learner(request: Request) -> Identity:
    """A caller who may answer questions: a student, or an instructor who tries them. Raises Forbidden."""
    identity = identity_in(request.scope)
    identity.require(Role.STUDENT, Role.INSTRUCTOR)
    return identity


async def instructor(request: Request) -> Identity:
    """A caller who is an instructor. Raises Forbidden."""
    identity = identity_in(request.scope)
    identity.require(Role.INSTRUCTOR)
    return identity


async def service(request: Request) -> Identity:
    """A caller that is another service, such as an LMS. Raises Forbidden."""
    identity = identity_in(request.scope)
    identity.require(Role.SERVICE)
    return identity


async def staff(request: Request) -> Identity:
    """A caller who is an instructor or another service. Raises Forbidden."""
    identity = identity_in(request.scope)
    identity.require(Role.INSTRUCTOR, Role.SERVICE)
    return identity


bearer = Security(HTTPBearer(auto_error=False, description="From `grader token create`."))
"""Documents the token in OpenAPI; AdmissionMiddleware checks it."""

AppContext = Annotated[Context, Depends(context_of)]
Anybody = Annotated[Identity, Depends(anybody)]
Learner = Annotated[Identity, Depends(learner)]
Instructor = Annotated[Identity, Depends(instructor)]
Service = Annotated[Identity, Depends(service)]
Staff = Annotated[Identity, Depends(staff)]
IfNoneMatch = Annotated[str, Header(alias="If-None-Match", max_length=1000)]
