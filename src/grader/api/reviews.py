"""`/reviews`: submissions that need a review, claims on them, and the reviewers' decisions."""

from datetime import timedelta
from typing import Annotated, Any, Self

from fastapi import APIRouter, Header, Response
from pydantic import BaseModel, ConfigDict, Field, model_validator
from sqlalchemy.orm import Session

from grader.api.context import AppContext, Context, Instructor
from grader.api.paging import NO_NUL, Page, PageParams, page_of
from grader.api.problems import documented
from grader.api.submissions import SubmissionView, etag_of, is_current, view, visible
from grader.courses import results
from grader.courses.audit import Action, record
from grader.domain.quiz import OpenQuestion
from grader.domain.verdict import Verdict, reviewed
from grader.errors import Conflict, NotFound, Outdated, Unconditional, Unprocessable
from grader.identity import Identity
from grader.store import reviews, submissions
from grader.store.submissions import AT_REST, SubmissionFilter
from grader.store.tables import ReviewClaim, Submission, now

router = APIRouter()

CLAIM = timedelta(minutes=15)
"""How long a claim holds; claiming again starts the time anew."""

COMMENT_CHARACTERS_MAX = 10_000

CHANGED = "The submission has changed since you saw it; look at it again."


class ClaimBody(BaseModel):
    """Which submission to claim: the one with this id, or the oldest of a question, a quiz, or the course."""

    model_config = ConfigDict(extra="forbid")

    quiz: str | None = Field(default=None, pattern=NO_NUL)
    question: str | None = Field(default=None, pattern=NO_NUL)
    submission_id: str | None = None

    @model_validator(mode="after")
    def _id_or_quiz(self) -> Self:
        if self.question is not None and self.quiz is None:
            raise ValueError("give `quiz` with `question`")
        if self.submission_id is not None and self.quiz is not None:
            raise ValueError("give either `submission_id` or `quiz`")
        return self


class ReviewBody(BaseModel):
    """A reviewer's decision."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)

    points: float = Field(ge=0, strict=True)
    comment: str = Field(default="", max_length=COMMENT_CHARACTERS_MAX)


class ReviewView(SubmissionView):
    """A submission for its reviewer, with the claim on it and the author's reference answer."""

    claim: dict[str, Any] | None
    reference: str | None = None


@router.get("/reviews", response_model=Page, responses=documented(401, 403, 422, 429))
def list_reviews(query: PageParams, who: Instructor, context: AppContext, response: Response) -> dict[str, Any]:
    """Lists the submissions that need a review, oldest first."""
    wanted = SubmissionFilter(who.course, query.user, query.quiz, query.question)
    with context.database.read() as session:
        waiting = reviews.page(session, wanted, query.start, query.limit + 1, now())
        verdicts = submissions.verdicts(session, [submission for submission, _ in waiting])
    items = [
        {**view(submission, verdicts.get(submission.id), with_answer=False, with_seed=True), "claim": claim_view(claim)}
        for submission, claim in waiting
    ]
    return page_of(items, query, "/reviews", response)


@router.post("/reviews:claim", response_model=ReviewView, responses=documented(401, 403, 404, 409, 413, 422, 429))
def claim_review(body: ClaimBody, who: Instructor, context: AppContext, response: Response) -> dict[str, Any]:
    """Claims a submission for 15 minutes, so that no other instructor reviews it. 404 if none needs a review."""
    with context.database.write() as session:
        context.database.lock(session, f"reviews\n{who.course}")
        submission = submission_to_claim(session, body, who)
        claim = reviews.put_claim(session, submission.id, who.user, now() + CLAIM)
        verdict = submissions.verdicts(session, [submission]).get(submission.id)
    response.headers["ETag"] = etag_of(submission)
    reference = reference_of(context, submission)
    return {**view(submission, verdict, with_seed=True), "claim": claim_view(claim), "reference": reference}


@router.put(
    "/submissions/{submission_id}/review",
    response_model=SubmissionView,
    responses=documented(401, 403, 404, 409, 412, 413, 422, 428, 429),
)
def review(
    submission_id: str,
    body: ReviewBody,
    who: Instructor,
    context: AppContext,
    response: Response,
    *,
    if_match: Annotated[str | None, Header(max_length=255)] = None,
) -> dict[str, Any]:
    """Adds the reviewer's verdict: its points count, and the learner sees the comment."""
    with context.database.write() as session:
        context.database.lock(session, f"reviews\n{who.course}")
        submission = free_for(session, visible(session, submission_id, who), who)
        refuse_outdated(submission, if_match)
        earlier = Verdict.model_validate(submissions.verdicts(session, [submission])[submission.id])
        try:
            verdict = reviewed(earlier, body.points, body.comment.strip())
        except ValueError as error:
            raise Unprocessable(f"{error}.") from error
        results.append_verdict(
            context.database,
            context.content.of(who.course).library,
            session,
            submission,
            verdict,
            cause="review",
            reviewer=who.user,
        )
        points = {"before": earlier.points, "after": verdict.points}
        record(session, who, who.course, Action.REVIEWED, submission.id, **points)
        reviews.drop_claim(session, submission.id)
    response.headers["ETag"] = etag_of(submission)
    return view(submission, verdict.model_dump(mode="json"), with_seed=True)


def submission_to_claim(session: Session, body: ClaimBody, who: Identity) -> Submission:
    """The submission to claim. Raises NotFound, Conflict."""
    if body.submission_id is not None:
        return free_for(session, visible(session, body.submission_id, who), who)
    found = reviews.oldest(session, SubmissionFilter(who.course, None, body.quiz, body.question), who.user, now())
    if found is None:
        raise NotFound("No submission needs a review here.")
    return found


def free_for(session: Session, submission: Submission, who: Identity) -> Submission:
    """The submission, if this reviewer may grade it now. Raises Conflict."""
    if submission.status not in AT_REST:
        raise Conflict("This submission is still being graded.")
    claim = reviews.claim_on(session, submission.id, now())
    if claim is not None and claim.reviewer != who.user:
        raise Conflict(f"{claim.reviewer} is reviewing this submission until {claim.expires_at:%H:%M} UTC.")
    return submission


def refuse_outdated(submission: Submission, if_match: str | None) -> None:
    """Checks that the reviewer saw the newest state. Raises Unconditional, Outdated."""
    if if_match is None:
        raise Unconditional("Send If-Match with the ETag of the submission that you review.")
    if not is_current(submission, if_match):
        raise Outdated(CHANGED)


def claim_view(claim: ReviewClaim | None) -> dict[str, Any] | None:
    """The reviewer who holds a submission, and until when."""
    return None if claim is None else {"by": claim.reviewer, "expires_at": claim.expires_at}


def reference_of(context: Context, submission: Submission) -> str | None:
    """The reference answer of an open question, if the content still has it."""
    try:
        question = context.content.of(submission.course).library.question(submission.quiz, submission.question)
    except NotFound:
        return None
    return question.reference if isinstance(question, OpenQuestion) else None
