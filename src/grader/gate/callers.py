"""The caller of a JSON route, by the role that the route asks for."""

from typing import Annotated

from fastapi import APIRouter, Depends, Header, Request, Security
from fastapi.security import HTTPBearer

from grader.courses.people.identity import Identity, Role
from grader.gate.admission import PREFIX, get_identity
from grader.gate.late_routes import LateRoute


async def anybody(request: Request) -> Identity:
    """Returns the caller, in any role."""
    return get_identity(request.scope)


async def learner(request: Request) -> Identity:
    """Returns a caller who may answer: a student, or an instructor who tries the questions. Raises Forbidden."""
    identity = get_identity(request.scope)
    identity.require(Role.STUDENT, Role.INSTRUCTOR)
    return identity


async def instructor(request: Request) -> Identity:
    """Returns a caller who is an instructor. Raises Forbidden."""
    identity = get_identity(request.scope)
    identity.require(Role.INSTRUCTOR)
    return identity


async def service(request: Request) -> Identity:
    """Returns a caller that is another service, such as an LMS. Raises Forbidden."""
    identity = get_identity(request.scope)
    identity.require(Role.SERVICE)
    return identity


async def staff(request: Request) -> Identity:
    """Returns a caller who is an instructor or another service. Raises Forbidden."""
    identity = get_identity(request.scope)
    identity.require(Role.INSTRUCTOR, Role.SERVICE)
    return identity


bearer = Security(HTTPBearer(auto_error=False, description="From `grader token create`."))
"""Documents the token in OpenAPI; AdmissionMiddleware checks it."""


def api_router(tag: str, prefix: str = "") -> APIRouter:
    """Returns a router for routes below /api/v1 and this prefix, which describe the token and stand under a tag."""
    return APIRouter(prefix=f"{PREFIX}{prefix}", dependencies=[bearer], tags=[tag], route_class=LateRoute)


Anybody = Annotated[Identity, Depends(anybody)]
Learner = Annotated[Identity, Depends(learner)]
Instructor = Annotated[Identity, Depends(instructor)]
Service = Annotated[Identity, Depends(service)]
Staff = Annotated[Identity, Depends(staff)]
IfNoneMatch = Annotated[str, Header(alias="If-None-Match", max_length=1000)]
