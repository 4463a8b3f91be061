"""`/submissions/{submission_id}/comments`: what instructors write to the lines of a script."""

from typing import Annotated, Any

from pydantic import Field, StringConstraints
from sqlalchemy.orm import Session

from grader.api.bodies import RequestBody
from grader.api.learning.submissions import find_visible
from grader.api.paging import NO_NUL, Cut, Page
from grader.courses.answering.access import read_access
from grader.courses.people.identity import Identity
from grader.courses.reviewing import line_comments
from grader.gate.callers import Instructor, Learner, api_router
from grader.gate.problems import refusals
from grader.gate.services import AppServices, Services
from grader.store.reviewing.line_comments import LineComment, on_submissions
from grader.store.tables import Submission

router = api_router("reviews")

LineText = Annotated[
    str, StringConstraints(strip_whitespace=True, min_length=1, max_length=line_comments.CHARACTERS_MAX, pattern=NO_NUL)
]


class LineBody(RequestBody):
    """A comment on a line of the script, from 1, or on all of it without one."""

    line: int | None = Field(default=None, ge=1, strict=True)
    text: LineText


COMMENTS = "/submissions/{submission_id}/comments"


@router.get(COMMENTS, response_model=Page, responses=refusals(401, 403, 404, 422, 429))
def list_line_comments(submission_id: str, who: Learner, services: AppServices, cut: Cut) -> dict[str, Any]:
    """Lists the comments on a script, those on all of it first, then line by line. Its learner sees them with the
    verdict."""
    with services.database.read() as session:
        submission = find_visible(session, submission_id, who)
        is_shown = who.is_instructor or is_released(session, services, who, submission)
        comments = on_submissions(session, [submission.id]).get(submission.id, []) if is_shown else []
    return cut([describe_comment(comment) for comment in comments])


@router.post(COMMENTS, status_code=201, responses=refusals(401, 403, 404, 413, 422, 429))
def write_line_comment(submission_id: str, body: LineBody, who: Instructor, services: AppServices) -> dict[str, Any]:
    """Writes a comment, which changes no points."""
    with services.database.write() as session:
        row = find_visible(session, submission_id, who)
        (comment,) = line_comments.write_comment(session, who, [(row, body.line)], body.text)
    return describe_comment(comment)


@router.delete(COMMENTS + "/{line_comment_id}", status_code=204, responses=refusals(401, 403, 404, 422, 429))
def delete_line_comment(submission_id: str, line_comment_id: str, who: Instructor, services: AppServices) -> None:
    """Deletes a comment, whoever wrote it."""
    with services.database.write() as session:
        line_comments.delete_comment(session, who, line_comment_id, submission_id)


def is_released(session: Session, services: Services, who: Identity, submission: Submission) -> bool:
    """Whether the learner may see the feedback on the submission by now."""
    at = submission.quiz, submission.question
    return read_access(session, services.content.get(who.course).library, who, at).decide(*at).withheld is None


def describe_comment(comment: LineComment) -> dict[str, Any]:
    """A comment as plain JSON."""
    return {name: getattr(comment, name) for name in ("id", "line", "text", "name", "created_at")}
