"""`/roster`: who takes part in a course, to and from other systems."""

from dataclasses import asdict
from typing import Annotated, Any

from fastapi import Query, Request
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import Response

from grader.api.bodies import ResponseBody
from grader.courses.people.identity import Identity
from grader.courses.people.rosters import oneroster, roster
from grader.courses.people.rosters.enrolment import enrol, list_roster, list_roster_with_ids
from grader.courses.people.rosters.roster import NAMESPACE, Roster
from grader.courses.rules.csv_cells import BOM
from grader.errors import Unprocessable
from grader.gate.callers import Staff, api_router
from grader.gate.problems import refusals
from grader.gate.services import AppServices, Services

router = api_router("people")

CSV, ZIP = "text/csv", "application/zip"
TEXT = {"schema": {"type": "string"}}
BINARY = {"schema": {"type": "string", "format": "binary"}}

Namespace = Annotated[str, Query(max_length=64)]


class RoleChangeView(ResponseBody):
    """A member whose role a roster changes."""

    id: str
    name: str
    before: str
    after: str


class LeftOutView(ResponseBody):
    """How many people a roster leaves out for one reason."""

    why: str
    people: int


class NamesakeView(ResponseBody):
    """A member who bears a name of a roster, and is found by none of its rows."""

    id: str
    name: str


class EnrolledView(ResponseBody):
    """What a roster came to, in members. `left_out` are people whom the file or the caller's rights exclude, for
    `reasons`; `roles` are the members whose role changes. `namesakes` may be people of the roster who came in by
    another way, and are members twice."""

    dry_run: bool
    created: int
    changed: int
    unchanged: int
    left_out: int
    reasons: list[LeftOutView]
    roles: list[RoleChangeView]
    namesakes: list[NamesakeView]


@router.post(
    "/roster:import",
    response_model=EnrolledView,
    responses=refusals(401, 403, 409, 413, 422, 429),
    openapi_extra={"requestBody": {"required": True, "content": {CSV: TEXT, ZIP: BINARY}}},
)
async def import_roster(
    request: Request,
    who: Staff,
    services: AppServices,
    namespace: Namespace = NAMESPACE,
    course_class: Annotated[str | None, Query(alias="class", max_length=255)] = None,
    *,
    dry_run: bool = False,
) -> dict[str, Any]:
    """Makes the people on a roster members: our own CSV as text/csv, or a OneRoster zip file as application/zip.

    All rows are taken or none: faults are listed with line and column. With `dry_run` nothing is changed.
    """
    media_type = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    return await run_in_threadpool(
        enrol_file, services, who, media_type, await request.body(), (namespace, course_class), dry_run=dry_run
    )


def enrol_file(
    services: Services, who: Identity, media_type: str, body: bytes, at: tuple[str, str | None], *, dry_run: bool
) -> dict[str, Any]:
    """Reads and enrols. Raises Unprocessable, FaultyRows, Conflict."""
    read = read_body(media_type, body, *at)
    with services.database.write() as session:
        return asdict(enrol(services.database, session, who, who.course, read, dry_run=dry_run))


def read_body(media_type: str, body: bytes, namespace: str, course_class: str | None) -> Roster:
    """Returns the people in a file. Raises Unprocessable, FaultyRows."""
    if media_type == CSV:
        return roster.read_roster(roster.decode(roster.FILE, body), namespace)
    if media_type == ZIP:
        return oneroster.read_zip(body, namespace, course_class)
    raise Unprocessable(f"Send the roster as {CSV}, or as {ZIP} with OneRoster's files.")


@router.get(
    "/roster.csv", response_class=Response, responses=refusals(401, 403, 422, 429, more={200: {"content": {CSV: TEXT}}})
)
def export_roster(who: Staff, services: AppServices, *, bom: bool = False) -> Response:
    """Sends the members of the course as CSV in our own form; `bom` marks it as UTF-8 for Excel."""
    with services.database.read() as session:
        entries = list_roster(session, who.course)
    text = (BOM if bom else "") + "".join(roster.write_roster(entries))
    return build_attachment(text.encode(), roster.FILE, f"{CSV}; charset=utf-8")


@router.get(
    "/roster.zip",
    response_class=Response,
    responses=refusals(401, 403, 422, 429, more={200: {"content": {ZIP: BINARY}}}),
)
def export_oneroster(who: Staff, services: AppServices, namespace: Namespace = NAMESPACE) -> Response:
    """Sends the members of the course as users.csv and enrollments.csv of OneRoster 1.2."""
    with services.database.read() as session:
        entries = list_roster_with_ids(session, who.course, namespace)
    return build_attachment(oneroster.write_zip(entries, who.course), "roster.zip", ZIP)


def build_attachment(body: bytes, name: str, media_type: str) -> Response:
    """A file to save."""
    headers = {"Content-Disposition": f'attachment; filename="{name}"'}
    return Response(body, media_type=media_type, headers=headers)
