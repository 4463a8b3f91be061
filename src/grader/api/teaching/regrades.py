"""`/regrades`: grades submissions again after a change of the content, in the background, or tries it out."""

from datetime import datetime
from typing import Annotated, Any, Literal

from fastapi import Query, Response
from pydantic import Field

from grader.api.bodies import RequestBody, ResponseBody
from grader.api.paging import NO_NUL, CursorQuery, Page, build_page, next_link, write_cursor
from grader.courses.regrading import regrades
from grader.courses.regrading.regrades import IDS_MAX, RegradeRequest, Scope, describe_regrade
from grader.courses.reviewing.blinding import blinded_differences
from grader.gate.admission import PREFIX
from grader.gate.callers import Instructor, api_router
from grader.gate.problems import refusals
from grader.gate.services import AppServices
from grader.store import regrades as stored

router = api_router("regrades")

Id = Annotated[str, Field(max_length=32, pattern=NO_NUL)]


class Submissions(RequestBody):
    """Submissions that are named one by one."""

    submission_ids: list[Id] = Field(min_length=1, max_length=IDS_MAX)


class RegradeBody(RequestBody):
    """What to grade again: a quiz or one question of it; `dry_run` tells the difference and changes nothing."""

    quiz: str = Field(max_length=64, pattern=NO_NUL)
    question: str | None = Field(default=None, max_length=64, pattern=NO_NUL)
    scope: Scope | Submissions
    dry_run: bool = True

    @property
    def wanted(self) -> RegradeRequest:
        """The same, without HTTP."""
        scope = self.scope if isinstance(self.scope, str) else tuple(self.scope.submission_ids)
        return RegradeRequest(self.quiz, self.question, scope, self.dry_run)


class Progress(ResponseBody):
    """How many submissions are in the scope and regraded, and what became of them."""

    total: int
    done: int
    outcomes: dict[str, int]


class RegradeView(ResponseBody):
    """A regrade. `reason` says why it failed."""

    id: str
    quiz: str
    question: str | None
    scope: Scope | Submissions
    dry_run: bool
    status: Literal["queued", "running", "done", "cancelled", "failed"]
    reason: str | None
    content_digest: str
    created_by: str
    created_at: datetime
    finished_at: datetime | None
    progress: Progress


class RegradePage(RegradeView):
    """A regrade with one page of its differences, one for each learner and question."""

    items: list[dict[str, Any]]
    next_cursor: str | None


class DifferenceQuery(CursorQuery):
    """Which page of the differences; `changed` leaves out learners whose verdicts stay."""

    changed: bool = False


@router.post(
    "/regrades", status_code=202, response_model=RegradeView, responses=refusals(401, 403, 404, 409, 413, 422, 429)
)
def create_regrade(body: RegradeBody, who: Instructor, services: AppServices, response: Response) -> dict[str, Any]:
    """Queues a regrade by the content that is loaded now. 409 while another one changes the same quiz."""
    regrade = regrades.create(services.database, services.content.get(who.course).library, who, body.wanted)
    response.headers["Location"] = f"{PREFIX}/regrades/{regrade.id}"
    with services.database.read() as session:
        return describe_regrade(regrade, stored.count_by_outcome(session, regrade))


@router.get("/regrades", response_model=Page, responses=refusals(401, 403, 422, 429))
def list_regrades(
    query: Annotated[CursorQuery, Query()], who: Instructor, services: AppServices, response: Response
) -> dict[str, Any]:
    """Lists the regrades of the course, newest first, without their differences."""
    with services.database.read() as session:
        rows = stored.page(session, who.course, query.start, query.limit + 1)
        items = [describe_regrade(regrade, stored.count_by_outcome(session, regrade)) for regrade in rows]
    return build_page(items, query, "/regrades", response)


@router.get("/regrades/{regrade_id}", response_model=RegradePage, responses=refusals(401, 403, 404, 422, 429))
def show_regrade(
    regrade_id: str,
    query: Annotated[DifferenceQuery, Query()],
    who: Instructor,
    services: AppServices,
    response: Response,
) -> dict[str, Any]:
    """Shows how far a regrade is, and the difference that it makes for each learner at each question."""
    with services.database.read() as session:
        regrade = regrades.get(session, regrade_id, who.course)
        counts = stored.count_by_outcome(session, regrade)
        differences = regrades.read_page(session, regrade, query.read_number(9), query.limit + 1, changed=query.changed)
        items = blinded_differences(services.desk_of(who.course), session, who, regrade.quiz, differences)
    cursor = None
    if len(items) > query.limit:
        items = items[: query.limit]
        cursor = write_cursor(str(items[-1]["place"]))
        following = query.model_copy(update={"cursor": cursor})
        response.headers["Link"] = next_link(f"/regrades/{regrade.id}", following)
    return describe_regrade(regrade, counts) | {"items": items, "next_cursor": cursor}


@router.post(
    "/regrades/{regrade_id}:cancel", response_model=RegradeView, responses=refusals(401, 403, 404, 409, 422, 429)
)
def cancel_regrade(regrade_id: str, who: Instructor, services: AppServices) -> dict[str, Any]:
    """Ends a regrade; what it has changed stays. 409 if it is over."""
    with services.database.write() as session:
        cancelled = regrades.cancel(session, who, regrade_id)
        return describe_regrade(cancelled, stored.count_by_outcome(session, cancelled))
