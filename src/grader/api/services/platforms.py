"""`/lti`: learning platforms, for instructors of the course `default`, and their courses, for those of the linked one.
A restricted token may do none of it: a link makes instructors."""

from typing import Annotated, Any

from fastapi import Depends, Request
from pydantic import Field

from grader.api.bodies import RequestBody, ResponseBody
from grader.api.paging import NO_NUL, Cut, Page, RowId
from grader.courses.people import platforms as rules
from grader.courses.people.identity import Identity
from grader.errors import NotFound
from grader.gate.callers import Instructor, api_router
from grader.gate.problems import refusals
from grader.gate.services import AppServices, Services
from grader.platforms import administration
from grader.platforms.tool import MISSING, Tool

router = api_router("platforms", "/lti")


async def administrator(who: Instructor) -> Identity:
    """An instructor of the course `default`, before the body is looked at. Raises Forbidden."""
    rules.require_administrator(who)
    return who


Administrator = Annotated[Identity, Depends(administrator)]

TEXT = 2000
LISTED = refusals(401, 403, 422, 429)
CHANGED = refusals(401, 403, 404, 409, 422, 429)


class PlatformBody(RequestBody):
    """A platform to register. `origins` are those that show our pages in a frame; of issuer and login if not given."""

    issuer: str = Field(max_length=TEXT)
    client_id: str = Field(max_length=TEXT)
    login_url: str = Field(max_length=TEXT)
    token_url: str = Field(max_length=TEXT)
    keys_url: str = Field(max_length=TEXT)
    name: str = Field(default="", max_length=200)
    token_audience: str = Field(default="", max_length=TEXT)
    deployment_id: str | None = Field(default=None, min_length=1, max_length=255)
    origins: list[str] = Field(default_factory=list, max_length=20)


class ApprovalBody(RequestBody):
    """Which deployment of a platform is approved; all that wait if it names none."""

    deployment_id: str | None = Field(default=None, min_length=1, max_length=255, pattern=NO_NUL)


class DeploymentView(ResponseBody):
    """An installation of this tool on a platform. Launches of one that is not approved are refused."""

    deployment_id: str
    approved: bool


class PlatformView(ResponseBody):
    """A learning platform. Nobody comes from it until it is approved."""

    id: int
    name: str
    issuer: str
    client_id: str
    login_url: str
    token_url: str
    keys_url: str
    origins: list[str]
    approved: bool
    deployments: list[DeploymentView]


class ContextView(ResponseBody):
    """A platform's course. `course` is the one here that it is linked with, `wanted` one that it asks for."""

    id: int
    platform: str
    title: str
    course: str | None
    wanted: str | None
    wanted_by: str | None
    has_roster: bool


class RegistrationView(ResponseBody):
    """A single-use address for dynamic registration, valid for two days."""

    url: str


class PulledView(ResponseBody):
    """What a roster came to: members, and people whom an instructor had removed."""

    members: int
    removed: int


@router.get("/platforms", response_model=Page[PlatformView], responses=LISTED)
def list_platforms(_who: Administrator, services: AppServices, cut: Cut) -> dict[str, Any]:
    """Lists the platforms of the installation with their deployments."""
    with services.database.read() as session:
        return cut(administration.list_platforms(session))


@router.post(
    "/platforms", status_code=201, response_model=PlatformView, responses=refusals(401, 403, 409, 413, 422, 429)
)
def add_platform(body: PlatformBody, who: Administrator, services: AppServices) -> dict[str, Any]:
    """Registers a platform, which then waits for approval."""
    given = administration.read_registration(body.model_dump())
    with services.database.write() as session:
        return administration.describe_platform(session, rules.add(session, who, given, body.deployment_id))


@router.post(
    "/platforms/{platform_id}:approve",
    response_model=PlatformView,
    responses=refusals(401, 403, 404, 409, 413, 422, 429),
)
def approve_platform(
    platform_id: RowId, who: Administrator, services: AppServices, body: ApprovalBody | None = None
) -> dict[str, Any]:
    """Approves a platform, and its deployments that wait. With `deployment_id` this one alone, also before it is heard
    of."""
    deployment_id = None if body is None else body.deployment_id
    with services.database.write() as session:
        return administration.describe_platform(session, rules.approve(session, who, platform_id, deployment_id))


@router.delete("/platforms/{platform_id}", status_code=204, responses=CHANGED)
def remove_platform(platform_id: RowId, who: Administrator, services: AppServices) -> None:
    """Removes a platform with all that its launches told. Members and answers stay."""
    with services.database.write() as session:
        rules.remove(session, who, platform_id)


@router.post("/registrations", status_code=201, response_model=RegistrationView, responses=CHANGED)
def make_registration_link(_who: Administrator, services: AppServices, request: Request) -> dict[str, Any]:
    """Makes an address to type into a platform that knows dynamic registration."""
    get_tool(services)
    with services.database.write() as session:
        return {"url": administration.registration_link(session, services.origin_of(request))}


@router.get("/contexts", response_model=Page[ContextView], responses=LISTED)
def list_contexts(who: Instructor, services: AppServices, cut: Cut) -> dict[str, Any]:
    """Lists the platforms' courses that are linked with this course, or ask to be."""
    with services.database.read() as session:
        return cut(administration.list_contexts(session, who.course))


@router.put("/contexts/{context_id}/link", status_code=204, responses=CHANGED)
def link_context(context_id: RowId, who: Instructor, services: AppServices) -> None:
    """Links a platform's course that asks for it with this course: who teaches there is an instructor here."""
    with services.database.write() as session:
        rules.get_own_context(session, who, context_id)
        rules.link(session, who, context_id, who.course)


@router.delete("/contexts/{context_id}/link", status_code=204, responses=CHANGED)
def unlink_context(context_id: RowId, who: Instructor, services: AppServices) -> None:
    """Ends or declines a link. Members and answers stay."""
    with services.database.write() as session:
        rules.get_own_context(session, who, context_id)
        rules.unlink(session, who, context_id)


@router.post("/contexts/{context_id}:roster", response_model=PulledView, responses=CHANGED)
async def pull_roster(context_id: RowId, who: Instructor, services: AppServices) -> dict[str, Any]:
    """Pulls the members of a platform's course into this one."""
    pulled = await administration.pull_roster(services.database, get_tool(services).authorized, who, context_id)
    return vars(pulled)


def get_tool(services: Services) -> Tool:
    """The LTI tool. Raises NotFound, which says what to install."""
    if services.tool is None:
        raise NotFound(MISSING)
    return services.tool
