"""`/devices`: a program on a learner's own machine asks for a token, RFC 8628; its owner confirms on the page."""

from typing import Any

from fastapi import Request, Response
from pydantic import Field

from grader.api.bodies import RequestBody
from grader.api.paging import NO_NUL
from grader.api.views import DeviceTokenView, NewDeviceView
from grader.courses.people import devices
from grader.courses.people.devices import Refusal
from grader.gate.callers import api_router
from grader.gate.problems import problem, refusals
from grader.gate.services import AppServices

NO_STORE = {"Cache-Control": "no-store"}

router = api_router("devices")


class DeviceBody(RequestBody):
    """What the program calls itself; its owner reads it beside the code."""

    client_name: str = Field(default="", max_length=200, pattern=NO_NUL)


class DeviceCodeBody(RequestBody):
    """The device's own code, which no page shows."""

    device_code: str = Field(max_length=200, pattern=NO_NUL)


@router.post("/devices", response_model=NewDeviceView, responses=refusals(413, 422, 429))
def begin_device(
    services: AppServices, request: Request, response: Response, body: DeviceBody | None = None
) -> dict[str, Any]:
    """Begins the sign-in of a device: show the user code and the address, then ask for the token."""
    with services.database.write() as session:
        device = devices.begin(session, "" if body is None else body.client_name)
    response.headers.update(NO_STORE)
    page = f"{services.origin_of(request)}/devices"
    return {
        **vars(device),
        "verification_uri": page,
        "verification_uri_complete": f"{page}?code={device.user_code}",
        "interval": devices.INTERVAL_S,
        "expires_in": int(devices.CODE.total_seconds()),
    }


@router.post("/devices:token", response_model=DeviceTokenView, responses=refusals(400, 413, 422, 429))
def get_device_token(body: DeviceCodeBody, services: AppServices, response: Response) -> Any:
    """Returns the token of a device once its owner has allowed it; else 400 with the `error` of RFC 8628."""
    with services.database.write() as session:
        answer = devices.ask(session, body.device_code)
    if isinstance(answer, Refusal):
        return problem(400, answer.why, NO_STORE, error=answer.error)
    response.headers.update(NO_STORE)
    return {
        "access_token": answer.token,
        "token_type": "Bearer",
        "expires_in": int(devices.TOKEN.total_seconds()),
        "scope": " ".join(sorted(devices.SCOPES)),
        "user": answer.user,
        "course": answer.course,
    }
