"""`/me`: who the caller is."""

from typing import Any

from grader.api.views import CallerView
from grader.gate.callers import Anybody, api_router
from grader.gate.problems import refusals

router = api_router("people")


@router.get("/me", response_model=CallerView, responses=refusals(401, 429))
def show_caller(who: Anybody) -> dict[str, Any]:
    """Shows whose token it is: the member, the course, the role, and the scopes of a restricted one."""
    scopes = None if who.scopes is None else sorted(who.scopes)
    return {"id": who.id, "user": who.user, "role": who.role, "course": who.course, "scopes": scopes}
