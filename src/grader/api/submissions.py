"""`/submissions` and `/answers:validate`."""

import json
import zlib
from collections.abc import Awaitable, Callable, Sequence
from datetime import datetime
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Header, Request, Response
from fastapi.exceptions import RequestValidationError
from pydantic import BaseModel
from pydantic_core import to_json
from sqlalchemy.orm import Session
from starlette.exceptions import HTTPException
from starlette.routing import Route

from grader.api.admission import SUBMISSIONS, authenticate_again
from grader.api.context import AppContext, Context, Learner, context_in, learner
from grader.api.intake import AnswerBody, is_json, key_of, own_answer
from grader.api.paging import Page, PageParams, page_of
from grader.api.problems import documented
from grader.courses.audit import Action, record
from grader.courses.blinding import Blinded, blinded
from grader.courses.handing_in import Answer, Receipt
from grader.courses.policy import Shown
from grader.courses.standing import Standing, require_opened, shown_verdict, standing_of
from grader.courses.stopping import stop
from grader.domain.verdict import Status, Verdict
from grader.errors import CallerError, InvalidAnswer, NotFound, Unprocessable
from grader.identity import Identity, Role
from grader.store import submissions
from grader.store.submissions import SubmissionFilter
from grader.store.tables import Submission

router = APIRouter()


class SubmissionView(BaseModel):
    """A submission. `withheld` says when the feedback comes, where it may not be seen yet.

    Lists leave out `answer`; only instructors see `seed`, which draws the hidden cases. In an anonymous quiz `user` is
    a pseudonym for instructors while the answer waits for a reviewer, and `learner` is None.
    """

    id: str
    quiz: str
    question: str
    learner: str | None
    user: str
    status: Literal["queued", "running", "graded", "needs_review"]
    attempt: int
    created_at: datetime
    revision: int
    verdict: Verdict | None
    withheld: str | None = None
    answer: Any = None
    seed: int | None = None


class Interpretation(BaseModel):
    """What was understood of an answer, or the reason why it cannot be read."""

    valid: bool
    read_as: str | None
    message: str | None


async def hand_in(request: Request) -> Response:
    """Reads, stores and answers."""
    return await answered(request, SUBMISSIONS, learner, own_answer)


async def answered(
    request: Request,
    path: str,
    caller: Callable[[Request], Awaitable[Identity]],
    read: Callable[[Context, Identity, bytes, str | None], Awaitable[Answer]],
) -> Response:
    """Answers a request that hands in at a path: `caller` says who may, `read` reads the answer.

    Raises Unauthorized, Forbidden, NotFound, Conflict, TooLarge, Unprocessable, TooManyRequests, HTTPException,
    RequestValidationError.
    """
    context = context_in(request.app)
    try:
        who = await caller(request)
        if not is_json(request):
            raise Unprocessable("Send the answer as application/json.")
        answer = await read(context, who, await request.body(), key_of(request))
        return await context.writer.put(answer, lambda: created(path, answer.receipt()))
    except (CallerError, HTTPException, RequestValidationError):
        await authenticate_again(request.scope, context.database)
        raise


def created(path: str, receipt: Receipt) -> Response:
    """The response to an answer that was taken: its submission lies below the path."""
    submission = receipt.submission
    shown = {"seed": None, **view_for(receipt.standing, submission, receipt.verdict)}
    headers = {"Location": f"{path}/{submission.id}", "ETag": etag_for(receipt.standing, submission, shown)}
    return Response(to_json(shown, inf_nan_mode="null"), receipt.http_status, headers, "application/json")


HAND_IN = Route(SUBMISSIONS, hand_in, methods=["POST"])
"""Served by the Shortcut; FastAPI's route at this path documents it."""


@router.post(
    "/submissions",
    status_code=201,
    response_model=SubmissionView,
    responses=documented(401, 403, 404, 409, 413, 422, 429, more={202: {"model": SubmissionView}}),
)
def create_submission(
    body: AnswerBody,
    idempotency_key: Annotated[str | None, Header(min_length=1, max_length=255)] = None,
) -> None:
    """Hands in an answer: 201 with the verdict if it is instant, else 202."""
    raise AssertionError("the Shortcut serves this")


@router.get("/submissions", response_model=Page, responses=documented(401, 403, 422, 429))
def list_submissions(query: PageParams, who: Learner, context: AppContext, response: Response) -> dict[str, Any]:
    """Lists submissions, newest first: the learner's own, or for an instructor all of the course."""
    learner = query.learner if who.is_instructor else who.id
    wanted = SubmissionFilter(who.course, query.user, query.quiz, query.question, learner)
    with context.database.read() as session:
        rows = submissions.page(session, wanted, query.start, query.limit + 1)
        standing = standing_of(session, context.content.of(who.course).library, who)
        shown = seen_by(session, context, who, rows)
    names = shown.names
    if names and (query.user or wanted.learner):  # who asks for a learner by name knows whose it is
        names = {}
        with context.database.write() as session:
            record(session, who, who.course, Action.LOOKED_UP, query.user or query.learner or "")
    items = [view_for(standing, row, shown.verdicts.get(row.id), names.get(row.id), with_answer=False) for row in rows]
    return page_of(items, query, "/submissions", response)


@router.get(
    "/submissions/{submission_id}",
    response_model=SubmissionView,
    responses=documented(401, 403, 404, 422, 429),
)
def show_submission(submission_id: str, who: Learner, context: AppContext, response: Response) -> dict[str, Any]:
    """Shows one submission with its verdict; its ETag changes whenever the submission does."""
    with context.database.read() as session:
        return document(session, context, who, visible(session, submission_id, who), response)


@router.post(
    "/submissions/{submission_id}:stop",
    response_model=SubmissionView,
    responses=documented(401, 403, 404, 409, 422, 429),
)
def stop_submission(submission_id: str, who: Learner, context: AppContext, response: Response) -> dict[str, Any]:
    """Takes one's own script out of the queue, which uses no attempt. 409 once it runs."""
    library = context.content.of(who.course).library
    with context.database.write() as session:
        stopped = stop(context.database, library, session, who, submission_id)
        return document(session, context, who, stopped, response)


def document(
    session: Session, context: Context, who: Identity, submission: Submission, response: Response
) -> dict[str, Any]:
    """One submission as the user may see it now; sets the ETag of the response."""
    blind = seen_by(session, context, who, [submission])
    at = submission.quiz, submission.question
    standing = standing_of(session, context.content.of(who.course).library, who, at)
    shown = view_for(standing, submission, blind.verdicts.get(submission.id), blind.names.get(submission.id))
    response.headers["ETag"] = etag_for(standing, submission, shown)
    return shown


@router.post("/answers:validate", responses=documented(401, 403, 404, 409, 413, 422, 429))
def validate_answer(body: AnswerBody, who: Learner, context: AppContext) -> Interpretation:
    """Tells how an answer would be read, without grading it or using an attempt. 409 before the quiz opens."""
    pipeline = context.content.of(who.course).pipeline
    require_opened(pipeline.library, body.quiz, who.role)
    try:
        read_as = pipeline.describe(pipeline.read(body.quiz, body.question, body.answer))
    except InvalidAnswer as error:
        return Interpretation(valid=False, read_as=None, message=str(error))
    return Interpretation(valid=True, read_as=read_as, message=None)


def visible(session: Session, submission_id: str, who: Identity) -> Submission:
    """The submission. Raises NotFound if it does not exist, or is not the caller's to see."""
    submission = submissions.get(session, submission_id) if submission_id.isalnum() else None
    if submission is None or not who.may_see(submission.learner, submission.course):
        raise NotFound("There is no such submission.")
    return submission


def seen_by(session: Session, context: Context, who: Identity, rows: Sequence[Submission]) -> Blinded:
    """The newest verdicts of submissions, and pseudonyms, without what an instructor is kept from knowing."""
    verdicts = submissions.verdicts(session, rows)
    return blinded(context.desk_of(who.course), session, who, rows, verdicts)


def view_for(
    standing: Standing,
    submission: Submission,
    verdict: Any | None,
    pseudonym: str | None = None,
    *,
    with_answer: bool = True,
) -> dict[str, Any]:
    """The submission with its newest verdict, as much of it as the user may see now; the seed for instructors only.

    Before the feedback, later revisions do not show.
    """
    decision = standing.decision(submission.quiz, submission.question)
    shown = view(
        submission,
        shown_verdict(verdict, decision),
        pseudonym,
        with_answer=with_answer,
        with_seed=standing.role == Role.INSTRUCTOR,
    )
    if decision.shown is Shown.RECEIPT:
        shown["revision"] = min(1, submission.revision)
    return shown | {"withheld": decision.withheld}


def view(
    submission: Submission,
    verdict: Any | None,
    pseudonym: str | None = None,
    *,
    with_answer: bool = True,
    with_seed: bool = False,
) -> dict[str, Any]:
    """The submission with a verdict as plain JSON, for instructors; its status is what the verdict says.

    A `pseudonym` replaces the learner's name and id.
    """
    shown = {
        "id": submission.id,
        "quiz": submission.quiz,
        "question": submission.question,
        "learner": submission.learner if pseudonym is None else None,
        "user": pseudonym or submission.user,
        "status": status_with(submission, verdict),
        "attempt": submission.attempt,
        "created_at": submission.created_at,
        "revision": submission.revision,
        "verdict": verdict,
    }
    if with_answer:
        shown["answer"] = json.loads(submission.answer) if submission.answer else None
    if with_seed:
        shown["seed"] = submission.seed
    return shown


def status_with(submission: Submission, verdict: Any | None) -> str:
    """The status of a submission whose verdict is shown as given: a withheld one must not differ by its status."""
    if submission.status not in submissions.AT_REST or verdict is None:
        return submission.status
    waits = verdict["status"] == Status.NEEDS_REVIEW
    return submissions.NEEDS_REVIEW if waits else submissions.GRADED


def etag_for(standing: Standing, submission: Submission, shown: dict[str, Any]) -> str:
    """As `etag_of`, for what a user is shown: a learner's also changes when the policy shows more or less.

    Before the feedback it depends on what is shown alone, so that it does not tell of a later verdict.
    """
    level = standing.decision(submission.quiz, submission.question).shown
    if standing.role != Role.STUDENT or level is Shown.FEEDBACK:
        return etag_of(submission)
    if level is Shown.RECEIPT:
        verdict = {**(shown["verdict"] or {}), "content_digest": None}  # the key may be all that differs in it
        told = json.dumps([verdict, *(shown[name] for name in ("status", "attempt", "withheld"))])
        return f'"{submission.id[-8:]}-r{zlib.crc32(told.encode()):08x}"'
    return f'{etag_of(submission)[:-1]}-{zlib.crc32(f"{level}".encode()):08x}"'


def is_current(submission: Submission, if_match: str) -> bool:
    """Whether an `If-Match` header names the submission as it is now, by an ETag of `etag_of` or `etag_for`."""
    version = etag_of(submission)[:-1]
    tags = [tag.strip() for tag in if_match.split(",")]
    return "*" in tags or any(tag == f'{version}"' or tag.startswith(f"{version}-") for tag in tags)


def etag_of(submission: Submission) -> str:
    """Changes whenever the submission does."""
    return f'"{submission.id[-8:]}-{submission.version}"'
