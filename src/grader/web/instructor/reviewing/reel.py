"""`/instructor/learners/{id}/reel/...`: a learner's attempts at one question one after the other."""

from typing import Annotated

from fastapi import Query, Request
from fastapi.responses import Response

from grader.courses.reviewing.blinding import hide_names
from grader.errors import NotFound
from grader.gate.late_routes import page_router
from grader.gate.services import AppServices
from grader.store import submissions
from grader.store.submissions import SubmissionFilter
from grader.web.frame.inputs import Instructor
from grader.web.frame.rendering import page
from grader.web.text.questions import list_titles
from grader.web.verdict.reel import NO_ATTEMPT, REEL_MAX, build_reel
from grader.web.verdict.work import compare_attempts, read_in_full

router = page_router()


@router.get("/instructor/learners/{learner}/reel/{quiz_id}/{question_id}")
def reel(
    learner: str, quiz_id: str, question_id: str, *, request: Request, services: AppServices, who: Instructor,
    attempt: Annotated[str | None, Query(max_length=64)] = None,
) -> Response:  # fmt: skip
    """A learner's attempts at a question, without those that are under review without a name. Raises Unauthorized,
    Forbidden, NotFound."""
    desk = services.desk_of(who.course)
    with services.database.read() as session:
        wanted = SubmissionFilter(who.course, quiz=quiz_id, question=question_id, learner=learner)
        rows = submissions.page(session, wanted, None, REEL_MAX)
        seen = hide_names(desk, session, who, rows, submissions.read_verdicts(session, rows))
    open_rows = [row for row in rows if row.id not in seen.names]
    if not open_rows:
        raise NotFound(NO_ATTEMPT)
    read = services.answers_in(desk.library)
    attempts = compare_attempts([read_in_full(row, read(row), seen.verdicts.get(row.id)) for row in open_rows])
    at = quiz_id, question_id
    titles = list_titles(desk.library)
    known = desk.library.question(quiz_id, question_id) if at in titles else None
    story, name = f"/instructor/learners/{learner}", open_rows[0].user
    return page(
        request, "reel.html", who=who, layout="instructor_base.html", here="grades/gradebook",
        title=f"{titles.get(at, question_id)}: {name}", up=(f"{story}#{quiz_id}--{question_id}", name),
        base=f"{story}/reel/{quiz_id}/{question_id}", pictures=None, reel=build_reel(attempts, known, attempt),
    )  # fmt: skip
