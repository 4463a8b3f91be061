"""`/devices`: a member confirms the code that a program shows, and sees and revokes the tokens of their devices."""

from fastapi import Request
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import RedirectResponse, Response

from grader.courses.people import devices
from grader.courses.people.identity import Identity
from grader.courses.people.tokens import describe_credential
from grader.errors import Conflict, NotFound, Unauthorized
from grader.gate.late_routes import page_router
from grader.gate.services import AppServices, Services
from grader.web.frame.inputs import Form, Visitor
from grader.web.frame.rendering import PRIVATE, page

PAGE = "/devices"
GUESS_COST = 20
"""Requests as which a code that nobody waits for counts, so that nobody tries many."""

SAID = {
    "allowed": "Allowed. Your device goes on by itself within a few seconds.",
    "refused": "Refused. The device gets no access.",
    "revoked": "Revoked. Programs on that device are refused from now on.",
}

router = page_router()


@router.get(PAGE)
async def show(request: Request, services: AppServices, who: Visitor, code: str = "", said: str = "") -> Response:
    """The devices of the member, and the one that waits behind a code; else how to sign in."""
    if who is None:
        begins = services.sessions.anonymous
        return page(request, "devices.html", 401, PRIVATE, who=None, code=code, begins=begins)
    waiting = await run_in_threadpool(services.sessions.reading, lambda session: devices.find_waiting(session, code))
    trouble = devices.UNKNOWN if code and waiting is None else ""
    if trouble:
        services.admission.by_user.charge(who.id, GUESS_COST)
    return await run_in_threadpool(
        render, request, services, who, code=code, waiting=waiting, trouble=trouble, said=SAID.get(said, "")
    )


@router.post(PAGE)
async def decide(request: Request, services: AppServices, who: Visitor, form: Form) -> Response:
    """Allows the device behind a code, or refuses it. Raises Unauthorized, Forbidden."""
    if who is None:
        raise Unauthorized("Sign in first.")
    code, allowed = form.get("code", ""), form.get("decision") == "allow"
    try:
        await run_in_threadpool(
            services.sessions.writing, lambda session: devices.decide(session, who, code, allowed=allowed)
        )
    except NotFound as error:
        services.admission.by_user.charge(who.id, GUESS_COST)
        return await run_in_threadpool(render, request, services, who, 404, code=code, trouble=str(error))
    except Conflict as error:
        return await run_in_threadpool(render, request, services, who, 409, trouble=str(error))
    return RedirectResponse(f"{PAGE}?said={'allowed' if allowed else 'refused'}", 303)


@router.post(PAGE + "/{token_id}/revoke")
def revoke(token_id: str, services: AppServices, who: Visitor) -> Response:
    """Revokes a token of the member's own. Raises Unauthorized, NotFound."""
    if who is None:
        raise Unauthorized("Sign in first.")
    services.sessions.writing(lambda session: devices.revoke_device(session, who, token_id))
    return RedirectResponse(f"{PAGE}?said=revoked", 303)


def render(
    request: Request, services: Services, who: Identity, status: int = 200, *, code: str = "",
    waiting: devices.WaitingDevice | None = None, trouble: str = "", said: str = "",
) -> Response:  # fmt: skip
    """Renders the page."""
    own = services.sessions.reading(
        lambda session: [describe_credential(device) for device in devices.list_devices(session, who)]
    )
    days = devices.TOKEN.days
    return page(
        request, "devices.html", status, PRIVATE, who=who, code=code, waiting=waiting, trouble=trouble, said=said,
        devices=own, days=days, allowed=SAID["allowed"],
    )  # fmt: skip
