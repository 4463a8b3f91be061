"""`/reviews`: what waits for a person, who has taken it up, and what they decide."""

from datetime import timedelta
from typing import Annotated, Any, Self

from fastapi import APIRouter, Header, Response
from pydantic import BaseModel, ConfigDict, Field, model_validator
from sqlalchemy.orm import Session

from grader.api.context import AppContext, Context, Instructor
from grader.api.paging import NO_NUL, Asked, Page, page_of
from grader.api.problems import documented
from grader.api.submissions import SubmissionView, etag_of, view, visible
from grader.domain.quiz import OpenQuestion
from grader.domain.verdict import Verdict, reviewed
from grader.errors import Conflict, NotFound, Outdated, Unconditional, Unprocessable
from grader.identity import Identity
from grader.store import reviews, submissions
from grader.store.submissions import AT_REST, Chosen
from grader.store.tables import ReviewClaim, Submission, now

router = APIRouter()

CLAIM = timedelta(minutes=15)
"""How long an instructor has a submission to themselves; claiming it again starts afresh."""

COMMENT_CHARACTERS_MAX = 10_000

CHANGED = "The submission has changed since you saw it; look at it again."


class ClaimBody(BaseModel):
    """Which submission: this one, or the one that has waited longest in a quiz, at a question, or anywhere."""

    model_config = ConfigDict(extra="forbid")

    quiz: str | None = Field(default=None, pattern=NO_NUL)
    question: str | None = Field(default=None, pattern=NO_NUL)
    submission_id: str | None = None

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        if self.question is not None and self.quiz is None:
            raise ValueError("a question is one of a quiz: give `quiz` too")
        if self.submission_id is not None and self.quiz is not None:
            raise ValueError("give either `submission_id` or `quiz`")
        return self


class ReviewBody(BaseModel):
    """A person's decision."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)

    points: float = Field(ge=0, strict=True)
    comment: str = Field(default="", max_length=COMMENT_CHARACTERS_MAX)


class ReviewView(SubmissionView):
    """A submission for its reviewer: who holds it, and what an author would have answered."""

    claim: dict[str, Any] | None
    reference: str | None = None


@router.get("/reviews", response_model=Page, responses=documented(401, 403, 422, 429))
def list_reviews(asked: Asked, who: Instructor, context: AppContext, response: Response) -> dict[str, Any]:
    """What waits for a review, oldest first."""
    chosen = Chosen(who.course, asked.user, asked.quiz, asked.question)
    with context.database.read() as session:
        waiting = reviews.page(session, chosen, asked.start, asked.limit + 1, now())
        verdicts = submissions.verdicts(session, [submission for submission, _ in waiting])
    items = [
        {**view(submission, verdicts.get(submission.id), with_answer=False), "claim": claim_view(claim)}
        for submission, claim in waiting
    ]
    return page_of(items, asked, "/reviews", response)


@router.post("/reviews:claim", response_model=ReviewView, responses=documented(401, 403, 404, 409, 413, 422, 429))
def claim_review(body: ClaimBody, who: Instructor, context: AppContext, response: Response) -> dict[str, Any]:
    """Takes a submission up, so that nobody else reviews it meanwhile; 404 where nothing waits."""
    with context.database.write() as session:
        context.database.lock(session, f"reviews\n{who.course}")
        submission = wanted(session, body, who)
        claim = reviews.put_claim(session, submission.id, who.user, now() + CLAIM)
        verdict = submissions.verdicts(session, [submission]).get(submission.id)
    response.headers["ETag"] = etag_of(submission)
    reference = reference_of(context, submission)
    return {**view(submission, verdict), "claim": claim_view(claim), "reference": reference}


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
    """Decides: the points count, the comment is shown to the learner; earlier verdicts are kept."""
    with context.database.write() as session:
        context.database.lock(session, f"reviews\n{who.course}")
        submission = free_for(session, visible(session, submission_id, who), who)
        refuse_outdated(submission, if_match)
        earlier = Verdict.model_validate(submissions.verdicts(session, [submission])[submission.id])
        try:
            verdict = reviewed(earlier, body.points, body.comment.strip())
        except ValueError as error:
            raise Unprocessable(f"{error}.") from error
        submissions.append_verdict(session, submission, verdict, "review", who.user)
        reviews.drop_claim(session, submission.id)
    response.headers["ETag"] = etag_of(submission)
    return view(submission, verdict.model_dump(mode="json"))


def wanted(session: Session, body: ClaimBody, who: Identity) -> Submission:
    """The submission to claim. Raises NotFound, Conflict."""
    if body.submission_id is not None:
        return free_for(session, visible(session, body.submission_id, who), who)
    found = reviews.oldest(session, Chosen(who.course, None, body.quiz, body.question), who.user, now())
    if found is None:
        raise NotFound("Nothing waits for a review here.")
    return found


def free_for(session: Session, submission: Submission, who: Identity) -> Submission:
    """The submission, if this person may decide over it now. Raises Conflict."""
    if submission.status not in AT_REST:
        raise Conflict("This submission is still being graded.")
    claim = reviews.claim_on(session, submission.id, now())
    if claim is not None and claim.reviewer != who.user:
        raise Conflict(f"{claim.reviewer} is reviewing this submission until {claim.expires_at:%H:%M} UTC.")
    return submission


def refuse_outdated(submission: Submission, if_match: str | None) -> None:
    """Two people who decide at once: the second is told. Raises Unconditional, Outdated."""
    if if_match is None:
        raise Unconditional("Send If-Match with the ETag of the submission that you decide over.")
    if if_match.strip() != "*" and etag_of(submission) not in map(str.strip, if_match.split(",")):
        raise Outdated(CHANGED)


def claim_view(claim: ReviewClaim | None) -> dict[str, Any] | None:
    """Who holds a submission, and until when."""
    return None if claim is None else {"by": claim.reviewer, "expires_at": claim.expires_at}


def reference_of(context: Context, submission: Submission) -> str | None:
    """The author's answer to an open question, if the content still has it."""
    try:
        question = context.content.library.question(submission.quiz, submission.question)
    except NotFound:
        return None
    return question.reference if isinstance(question, OpenQuestion) else None
