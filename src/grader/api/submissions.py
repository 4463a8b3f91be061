"""`/submissions` and `/answers:validate`."""

import json
from datetime import datetime
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Header, Request, Response
from pydantic import BaseModel
from sqlalchemy.orm import Session

from grader.api.context import AppContext, Learner
from grader.api.gate import PREFIX
from grader.api.intake import AnswerBody, canonical, take_in
from grader.api.paging import Asked, Page, page_of
from grader.api.problems import documented
from grader.domain.verdict import Verdict
from grader.errors import InvalidAnswer, NotFound
from grader.identity import Identity
from grader.store import submissions
from grader.store.submissions import Chosen
from grader.store.tables import Submission

router = APIRouter()


class SubmissionView(BaseModel):
    """A submission as its learner and their instructor see it. `answer` is left out of lists."""

    id: str
    quiz: str
    question: str
    user: str
    status: Literal["queued", "running", "graded", "needs_review"]
    attempt: int
    created_at: datetime
    revision: int
    verdict: Verdict | None
    answer: Any = None


class Reading(BaseModel):
    """What was understood of an answer; `message` says why it was not."""

    valid: bool
    read_as: str | None
    message: str | None


@router.post(
    "/submissions",
    status_code=201,
    response_model=SubmissionView,
    responses=documented(401, 403, 404, 409, 413, 422, 429, more={202: {"model": SubmissionView}}),
)
def hand_in(
    body: AnswerBody,
    who: Learner,
    context: AppContext,
    response: Response,
    idempotency_key: Annotated[str | None, Header(min_length=1, max_length=255)] = None,
) -> dict[str, Any]:
    """Hands an answer in: 201 with the verdict where it is instant, else 202."""
    receipt = take_in(context, who, body, idempotency_key)
    response.status_code = receipt.http_status
    response.headers["Location"] = f"{PREFIX}/submissions/{receipt.submission.id}"
    response.headers["ETag"] = etag_of(receipt.submission)
    return view(receipt.submission, receipt.verdict)


@router.get("/submissions", response_model=Page, responses=documented(401, 403, 422, 429))
def list_submissions(asked: Asked, who: Learner, context: AppContext, response: Response) -> dict[str, Any]:
    """The newest first: one's own, or for an instructor everybody's in the course."""
    before = asked.start
    if not who.is_instructor and asked.user not in (None, who.user):
        return {"items": [], "next_cursor": None}
    chosen = Chosen(who.course, asked.user if who.is_instructor else who.user, asked.quiz, asked.question)
    with context.database.read() as session:
        rows = submissions.page(session, chosen, before, asked.limit + 1)
        verdicts = submissions.verdicts(session, rows)
    items = [view(row, verdicts.get(row.id), with_answer=False) for row in rows]
    return page_of(items, asked, "/submissions", response)


@router.get(
    "/submissions/{submission_id}",
    response_model=SubmissionView,
    responses=documented(401, 403, 404, 422, 429, more={304: {"description": "Not modified"}}),
)
def show_submission(
    submission_id: str, who: Learner, context: AppContext, request: Request, response: Response
) -> dict[str, Any] | Response:
    """One submission with its verdict; its ETag changes with every change of it."""
    with context.database.read() as session:
        submission = visible(session, submission_id, who)
        verdict = submissions.verdicts(session, [submission]).get(submission.id)
    etag = etag_of(submission)
    known = request.headers.get("if-none-match", "")
    if etag in known or known.strip() == "*":
        return Response(status_code=304, headers={"ETag": etag})
    response.headers["ETag"] = etag
    return view(submission, verdict)


@router.post("/answers:validate", responses=documented(401, 403, 404, 413, 422, 429))
def validate_answer(body: AnswerBody, _who: Learner, context: AppContext) -> Reading:
    """What the service understands of an answer; it is not graded and uses no attempt."""
    canonical(body.answer)
    try:
        read_as = context.content.pipeline.read_answer(body.quiz, body.question, body.answer)
    except InvalidAnswer as error:
        return Reading(valid=False, read_as=None, message=str(error))
    return Reading(valid=True, read_as=read_as, message=None)


def visible(session: Session, submission_id: str, who: Identity) -> Submission:
    """The submission. Raises NotFound where it is not there, or not theirs to see."""
    submission = submissions.get(session, submission_id) if submission_id.isalnum() else None
    if submission is None or not who.may_see(submission.user, submission.course):
        raise NotFound("There is no such submission.")
    return submission


def view(submission: Submission, verdict: Any | None, with_answer: bool = True) -> dict[str, Any]:
    """The submission as plain JSON; `verdict` is the one that counts."""
    shown = {
        "id": submission.id,
        "quiz": submission.quiz,
        "question": submission.question,
        "user": submission.user,
        "status": submission.status,
        "attempt": submission.attempt,
        "created_at": submission.created_at,
        "revision": submission.revision,
        "verdict": verdict,
    }
    return {**shown, "answer": json.loads(submission.answer)} if with_answer else shown


def etag_of(submission: Submission) -> str:
    """Changes whenever the submission does."""
    return f'"{submission.id[-8:]}-{submission.version}"'
