"""`/results`: the append-only feed of results and their revisions, for an LMS or another service."""

from typing import Annotated, Any

from fastapi import Query, Response

from grader.api.paging import CursorQuery, Page, next_link, write_cursor
from grader.api.views import ResultView
from grader.courses.people.external import OWN, External, known_as
from grader.gate.callers import Service, api_router
from grader.gate.problems import refusals
from grader.gate.services import AppServices
from grader.store import results
from grader.store.tables import Member, ResultRevision

router = api_router("results")

COLUMNS = (
    "submission_id", "quiz", "question", "attempt", "points", "max_points", "is_late", "is_final",
    "revision", "created_at",
)  # fmt: skip


@router.get("/results", response_model=Page[ResultView], responses=refusals(401, 403, 422, 429))
def list_results(
    query: Annotated[CursorQuery, Query()], who: Service, services: AppServices, response: Response
) -> dict[str, Any]:
    """Lists what counts for learners, one row for every change, oldest first.

    `next_cursor` is always given: the last one goes on with the rows that come later. A row never changes; a later
    `revision` of the same learner and question replaces it.
    """
    start = query.read_number()
    with services.database.read() as session:
        has_new = results.has_new(session, who.course)
    if has_new:
        with services.database.write() as session:
            services.database.lock(session, f"feed\n{who.course}")
            results.number_new(session, who.course)
    with services.database.read() as session:
        rows = results.list_feed(session, who.course, start, query.limit + 1)
    items = [build_item(*row) for row in rows[: query.limit]]
    last = rows[len(items) - 1][0].position if items else start
    following = query.model_copy(update={"cursor": write_cursor(str(last))})
    if len(rows) > len(items):
        response.headers["Link"] = next_link("/results", following)
    return {"items": items, "next_cursor": following.cursor}


def build_item(row: ResultRevision, user: str, member: Member | None) -> dict[str, Any]:
    """A row of the feed as plain JSON; `user` is the learner's name."""
    learner = External(OWN, row.learner) if member is None else known_as(member)
    return {"user": user, "member": row.learner, "learner": vars(learner)} | {
        name: getattr(row, name) for name in COLUMNS
    }
