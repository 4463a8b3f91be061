"""`/submissions` and `/answers:validate`."""

import json
import zlib
from collections.abc import Callable, Coroutine, Sequence
from datetime import datetime
from math import isfinite
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Header, Request, Response
from fastapi.concurrency import run_in_threadpool
from fastapi.exceptions import RequestValidationError
from pydantic import BaseModel, ConfigDict, Field
from pydantic_core import to_json
from sqlalchemy.orm import Session
from starlette.exceptions import HTTPException

from grader.api.bodies import RequestBody, ResponseBody
from grader.api.paging import Page, PageParams, build_page
from grader.courses.answering.access import read_access
from grader.courses.answering.intake import NewAnswer, Receipt
from grader.courses.answering.stopping import stop
from grader.courses.people.audit import Action, record
from grader.courses.people.identity import Identity, Role
from grader.courses.reviewing.blinding import BlindedVerdicts, hide_names
from grader.courses.rules.policy import Decision, Visibility, redact_json
from grader.courses.rules.progress import ComparedAttempt, describe_progress
from grader.domain.verdict import Status, Verdict
from grader.errors import CallerError, Conflict, InvalidAnswer, NotFound, Unprocessable
from grader.gate.admission import PREFIX, SUBMISSIONS, authenticate_again, get_identity
from grader.gate.callers import Learner, api_router
from grader.gate.late_routes import LateRoute
from grader.gate.problems import refusals
from grader.gate.services import AppServices, Services, get_services
from grader.store import submissions
from grader.store.submissions import SubmissionFilter
from grader.store.tables import Submission

router = api_router("submissions")


class AnswerFields(BaseModel):
    """An answer to one question, in a body that is short."""

    model_config = ConfigDict(extra="forbid")

    quiz: str = Field(max_length=64)
    question: str = Field(max_length=64)
    answer: Any


class AnswerBody(AnswerFields, RequestBody):
    """An answer to one question, by its kind: an option index, a number or text, `{"source": "..."}`, or in base64
    `{"file": "..."}`; of several parts a list of indices or ids, or an object with a text, a number or an id for each.
    """


KEY_MAX = 255
"""Longest idempotency key [characters]."""

IdempotencyKey = Annotated[str | None, Header(min_length=1, max_length=KEY_MAX)]
"""The same key makes the same submission."""


COMPARED_MAX = 20
"""Attempts that are read to compare one with, the newest ones."""


class SubmissionView(ResponseBody):
    """A submission. `withheld` says when the feedback comes, where it may not be seen yet; `progress`, to its learner,
    how it compares with their earlier attempts, such as the same mistake again. Lists leave out `answer`;
    only instructors see `seed`, which draws the hidden cases. In an anonymous quiz `user` is a pseudonym for
    instructors while the answer waits for a reviewer, and `learner` is None."""

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
    progress: str | None = None
    answer: Any = None
    seed: int | None = None


class Interpretation(ResponseBody):
    """What was understood of an answer, or the reason why it cannot be read."""

    valid: bool
    read_as: str | None
    message: str | None


class AnswerRoute(LateRoute):
    """A route that takes an answer of a caller in one of `roles`. Admission has only recalled the credential, and
    storing an answer checks it. A refused request stores nothing, so its credential is checked here: 401 comes before
    403, and both before any error of the body."""

    roles: tuple[Role, ...] = (Role.STUDENT, Role.INSTRUCTOR)

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """The handler of FastAPI, with the checks."""
        handle = super().get_route_handler()

        async def handle_or_authenticate(request: Request) -> Response:
            try:
                get_identity(request.scope).require(*self.roles)
                return await handle(request)
            except (CallerError, HTTPException, RequestValidationError):
                await authenticate_again(request.scope, get_services(request.app).database)
                raise

        return handle_or_authenticate


SECURITY: dict[str, Any] = {"security": [{"HTTPBearer": []}]}
"""Documents the token in OpenAPI, as `bearer` does: FastAPI would run a dependency with every request."""

answers = APIRouter(prefix=PREFIX, tags=["submissions"], route_class=AnswerRoute)


@answers.post(
    "/submissions",
    status_code=201,
    response_model=SubmissionView,
    responses=refusals(401, 403, 404, 409, 413, 422, 429, more={202: {"model": SubmissionView}}),
    openapi_extra=SECURITY,
)
async def create_submission(request: Request, body: AnswerBody, idempotency_key: IdempotencyKey = None) -> Response:
    """Hands in an answer: 201 with the verdict if it is instant, else 202."""
    services, who = get_services(request.app), get_identity(request.scope)
    answer = await run_in_threadpool(read_answer, services, who, body, idempotency_key)
    return respond_created(SUBMISSIONS, await services.writer.put(answer))


def read_answer(
    services: Services, who: Identity, body: AnswerFields, key: str | None, *, is_short: bool = False
) -> NewAnswer:
    """Reads an answer, and grades it where that is instant. Raises NotFound, TooLarge, Unprocessable; and Conflict for
    one that `is_short` and yet may take simulations."""
    require_finite(body.answer)
    pipeline = services.content.get(who.course).pipeline
    is_drawn = (body.quiz, body.question) in pipeline.drawn
    if is_drawn and is_short:
        raise Conflict("The key of this question is simulated: its answers take the long way.")
    learner = who.drawn_for if is_drawn else ""
    parsed, verdict = pipeline.read_and_grade(body.quiz, body.question, body.answer, learner)
    return NewAnswer(who, pipeline.library, parsed, verdict, key, services.settings.queue_per_user)


def require_finite(answer: Any) -> None:
    """Raises Unprocessable for an answer with numbers that JSON has not. Parsers take NaN and Infinity, and
    make infinity of 1e999; no other program could read what is stored of them."""
    unread = [answer]
    while unread:
        value = unread.pop()
        if isinstance(value, dict | list):
            unread += value.values() if isinstance(value, dict) else value
        elif isinstance(value, float) and not isfinite(value):
            raise Unprocessable("The answer is not JSON, which has no NaN, no Infinity and no number beyond 1.8e308.")


def respond_created(path: str, receipt: Receipt) -> Response:
    """The response to an answer that was taken: its submission lies below the path."""
    submission = receipt.submission
    shown = {"seed": None, **describe_for(receipt.decision, submission, receipt.verdict)}
    headers = {"Location": f"{path}/{submission.id}", "ETag": compute_etag_for(receipt.decision, submission, shown)}
    return Response(to_json(shown, inf_nan_mode="null"), receipt.http_status, headers, "application/json")


@router.get("/submissions", response_model=Page, responses=refusals(401, 403, 422, 429))
def list_submissions(query: PageParams, who: Learner, services: AppServices, response: Response) -> dict[str, Any]:
    """Lists submissions, newest first: the learner's own, or for an instructor all of the course."""
    learner = query.learner if who.is_instructor else who.id
    wanted = SubmissionFilter(who.course, query.user, query.quiz, query.question, learner)
    with services.database.read() as session:
        rows = submissions.page(session, wanted, query.start, query.limit + 1)
        access = read_access(session, services.content.get(who.course).library, who)
        shown = read_seen(session, services, who, rows)
    names = shown.names
    if names and (query.user or wanted.learner):  # who asks for a learner by name knows whose it is
        names = {}
        with services.database.write() as session:
            record(session, who, who.course, Action.LOOKED_UP, query.user or query.learner or "")
    items = [
        describe_for(
            access.decide(row.quiz, row.question), row, shown.verdicts.get(row.id), names.get(row.id), with_answer=False
        )
        for row in rows
    ]
    return build_page(items, query, "/submissions", response)


@router.get("/submissions/{submission_id}", response_model=SubmissionView, responses=refusals(401, 403, 404, 422, 429))
def show_submission(submission_id: str, who: Learner, services: AppServices, response: Response) -> dict[str, Any]:
    """Shows one submission with its verdict; its ETag changes whenever the submission does."""
    with services.database.read() as session:
        return build_document(session, services, who, find_visible(session, submission_id, who), response)


@router.post(
    "/submissions/{submission_id}:stop", response_model=SubmissionView, responses=refusals(401, 403, 404, 409, 422, 429)
)
def stop_submission(submission_id: str, who: Learner, services: AppServices, response: Response) -> dict[str, Any]:
    """Stops one's own script, which uses no attempt before its hidden cases have begun. 409 once it has its verdict."""
    stop(services.database, services.content.get(who.course).library, who, submission_id)
    with services.database.read() as session:
        return build_document(session, services, who, find_visible(session, submission_id, who), response)


def build_document(
    session: Session, services: Services, who: Identity, submission: Submission, response: Response
) -> dict[str, Any]:
    """One submission as the user may see it now; sets the ETag of the response."""
    blind = read_seen(session, services, who, [submission])
    at = submission.quiz, submission.question
    decision = read_access(session, services.content.get(who.course).library, who, at).decide(*at)
    shown = describe_for(decision, submission, blind.verdicts.get(submission.id), blind.names.get(submission.id))
    if submission.learner == who.id and shown["verdict"] is not None and submission.attempt > 1:
        shown["progress"] = compare_attempts(session, decision, submission, shown["verdict"]) or None
    response.headers["ETag"] = compute_etag_for(decision, submission, shown)
    return shown


def compare_attempts(session: Session, decision: Decision, submission: Submission, verdict: Any) -> str:
    """Says how a verdict compares with those on the learner's earlier attempts, as far as they may be seen."""
    wanted = SubmissionFilter(submission.course, quiz=submission.quiz, question=submission.question,
                              learner=submission.learner)  # fmt: skip
    rows = [row for row in submissions.page(session, wanted, None, COMPARED_MAX) if row.attempt < submission.attempt]
    verdicts = submissions.read_verdicts(session, rows)
    shown = [(row.attempt, redact_json(verdicts.get(row.id), decision)) for row in reversed(rows)]
    earlier = [ComparedAttempt(attempt, one) for attempt, one in shown if one]
    return describe_progress(earlier, ComparedAttempt(submission.attempt, verdict))


@router.post("/answers:validate", responses=refusals(401, 403, 404, 409, 413, 422, 429))
def validate_answer(body: AnswerBody, who: Learner, services: AppServices) -> Interpretation:
    """Tells how an answer would be read, without grading it or using an attempt. 409 before the quiz opens."""
    pipeline = services.content.get(who.course).pipeline
    services.require_opened(pipeline.library, who, body.quiz)
    require_finite(body.answer)
    try:
        read_as = pipeline.describe(pipeline.read(body.quiz, body.question, body.answer, learner=who.drawn_for))
    except InvalidAnswer as error:
        return Interpretation(valid=False, read_as=None, message=str(error))
    return Interpretation(valid=True, read_as=read_as, message=None)


def find_visible(session: Session, submission_id: str, who: Identity) -> Submission:
    """The submission. Raises NotFound if it does not exist, or is not the caller's to see."""
    submission = submissions.get(session, submission_id) if submission_id.isalnum() else None
    if submission is None or not who.may_see(submission.learner, submission.course):
        raise NotFound("There is no such submission.")
    return submission


def read_seen(session: Session, services: Services, who: Identity, rows: Sequence[Submission]) -> BlindedVerdicts:
    """The newest verdicts of submissions, and pseudonyms, without what an instructor is kept from knowing."""
    return hide_names(services.desk_of(who.course), session, who, rows, submissions.read_verdicts(session, rows))


def describe_for(
    decision: Decision,
    submission: Submission,
    verdict: Any | None,
    pseudonym: str | None = None,
    *,
    with_answer: bool = True,
) -> dict[str, Any]:
    """The submission with its newest verdict, as much of it as the user may see now; the seed for instructors only.
    Before the feedback, later revisions do not show."""
    redacted = redact_json(verdict, decision)
    shown = describe_submission(submission, redacted, pseudonym, with_answer=with_answer, with_seed=decision.sees_all)
    if decision.shown is Visibility.RECEIPT:
        shown["revision"] = min(1, submission.revision)
    return shown | {"withheld": decision.withheld}


def describe_submission(
    submission: Submission,
    verdict: Any | None,
    pseudonym: str | None = None,
    *,
    with_answer: bool = True,
    with_seed: bool = False,
) -> dict[str, Any]:
    """The submission with a verdict as plain JSON, for instructors; its status is what the verdict says. A `pseudonym`
    replaces the learner's name and id."""
    shown = {
        "id": submission.id, "quiz": submission.quiz, "question": submission.question,
        "learner": submission.learner if pseudonym is None else None, "user": pseudonym or submission.user,
        "status": status_with(submission, verdict), "attempt": submission.attempt, "created_at": submission.created_at,
        "revision": submission.revision, "verdict": verdict, "progress": None,
    }  # fmt: skip
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


def compute_etag_for(decision: Decision, submission: Submission, shown: dict[str, Any]) -> str:
    """As `compute_etag`, for what a user is shown: a learner's also changes when the policy shows more or less. Before
    the feedback it depends on what is shown alone, so that it does not tell of a later verdict."""
    level = decision.shown
    if decision.sees_all or level is Visibility.FEEDBACK:
        return compute_etag(submission)
    if level is Visibility.RECEIPT:
        verdict = {**(shown["verdict"] or {}), "content_digest": None}  # the key may be all that differs in it
        text = json.dumps([verdict, *(shown[name] for name in ("status", "attempt", "withheld"))])
        return f'"{submission.id[-8:]}-r{zlib.crc32(text.encode()):08x}"'
    return f'{compute_etag(submission)[:-1]}-{zlib.crc32(f"{level}".encode()):08x}"'


def is_current(submission: Submission, if_match: str) -> bool:
    """Whether an `If-Match` header names the submission as it is now, by an ETag of either function."""
    version = compute_etag(submission)[:-1]
    tags = [tag.strip() for tag in if_match.split(",")]
    return "*" in tags or any(tag == f'{version}"' or tag.startswith(f"{version}-") for tag in tags)


def compute_etag(submission: Submission) -> str:
    """Changes whenever the submission does."""
    return f'"{submission.id[-8:]}-{submission.version}"'
