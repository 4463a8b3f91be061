"""What the routes work with: the database, the content, and who is asking."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

from fastapi import Depends, Request, Security
from fastapi.security import HTTPBearer

from grader.api.content import Content
from grader.api.gate import identity_in
from grader.api.lab_cache import LabCache
from grader.identity import Identity, Role
from grader.store.database import Database


@dataclass(frozen=True)
class Context:
    """One per app. `wake` tells the embedded worker that there is something to do."""

    database: Database
    content: Content
    queue_per_user: int
    wake: Callable[[], None]
    labs: LabCache


async def context_of(request: Request) -> Context:
    """The app's context."""
    context: Context = request.app.state.context
    return context


async def anybody(request: Request) -> Identity:
    """Whoever has a valid token or session: the gate let nobody else through."""
    return identity_in(request.scope)


async def learner(request: Request) -> Identity:
    """Somebody who answers questions; instructors may try their own. Raises Forbidden."""
    identity = identity_in(request.scope)
    identity.require(Role.STUDENT, Role.INSTRUCTOR)
    return identity


async def instructor(request: Request) -> Identity:
    """Raises Forbidden for everybody else."""
    identity = identity_in(request.scope)
    identity.require(Role.INSTRUCTOR)
    return identity


bearer = Security(HTTPBearer(auto_error=False, description="From `grader token create`."))
"""For the OpenAPI description; the gate is what checks."""

AppContext = Annotated[Context, Depends(context_of)]
Anybody = Annotated[Identity, Depends(anybody)]
Learner = Annotated[Identity, Depends(learner)]
Instructor = Annotated[Identity, Depends(instructor)]
