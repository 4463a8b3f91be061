"""`/reviews`: submissions that wait for a reviewer, claims on them, and the reviewers' marks."""

import json
from collections.abc import Sequence
from typing import Annotated, Any, Self

from fastapi import Header, Query, Response
from pydantic import Field, model_validator
from sqlalchemy.orm import Session

from grader.api.bodies import RequestBody, ResponseBody
from grader.api.learning.submissions import SubmissionView, compute_etag, describe_submission, find_visible, is_current
from grader.api.paging import NO_NUL, Page, PageQuery, QuestionQuery, build_page
from grader.api.teaching.saved_comments import describe_comment
from grader.courses.people.identity import Identity
from grader.courses.reviewing import reviews, rubric_changes
from grader.courses.reviewing.blinding import hide_names
from grader.courses.reviewing.comments import REVIEW_CHARACTERS_MAX
from grader.courses.rules.rubric import Mark, get_rubric
from grader.domain.rubric import ITEMS_MAX
from grader.errors import Outdated, Unconditional
from grader.gate.callers import Instructor, api_router
from grader.gate.problems import refusals
from grader.gate.services import AppServices, Services
from grader.questions import kind_of
from grader.store import submissions
from grader.store.reviewing import reviews as stored
from grader.store.reviewing.reviews import find_comments
from grader.store.submissions import SubmissionFilter
from grader.store.tables import Review, ReviewClaim, Submission, now

router = api_router("reviews")

CHANGED = "The submission has changed since you saw it; look at it again."


class ReviewQuery(PageQuery):
    """The query parameters of the list of what waits: for a first mark, or with `second` for a second one by you."""

    second: bool = False


class ClaimBody(RequestBody):
    """Which submission to claim: the one with this id, or the oldest of a question, a quiz, or the course. With
    `second`, one that waits for a second mark."""

    quiz: str | None = Field(default=None, pattern=NO_NUL)
    question: str | None = Field(default=None, pattern=NO_NUL)
    submission_id: str | None = None
    second: bool = False

    @model_validator(mode="after")
    def _id_or_quiz(self) -> Self:
        if self.question is not None and self.quiz is None:
            raise ValueError("give `quiz` with `question`")
        if self.submission_id is not None and self.quiz is not None:
            raise ValueError("give either `submission_id` or `quiz`")
        return self


class HeldBody(RequestBody):
    """A submission that the caller has claimed."""

    submission_id: str


class QuestionBody(RequestBody):
    """One question."""

    quiz: str = Field(max_length=64, pattern=NO_NUL)
    question: str = Field(max_length=64, pattern=NO_NUL)


class ReviewBody(RequestBody):
    """A reviewer's mark: the ids of the `rubric` items that hold, or `points`; with both, the points count."""

    points: float | None = Field(default=None, ge=0, strict=True)
    rubric: list[Annotated[str, Field(max_length=64)]] | None = Field(default=None, max_length=ITEMS_MAX)
    comment: str = Field(default="", max_length=REVIEW_CHARACTERS_MAX, pattern=NO_NUL)

    @model_validator(mode="after")
    def _points_or_items(self) -> Self:
        if self.points is None and self.rubric is None:
            raise ValueError("give `points`, or the items of the `rubric`")
        return self

    @property
    def mark(self) -> Mark:
        """The same, as reviewing works with it; each item once."""
        ticked = None if self.rubric is None else tuple(dict.fromkeys(self.rubric))
        return Mark(ticked, self.points, self.comment.strip())


class ReviewView(SubmissionView):
    """A submission for its reviewer, with the claim on it, the rubric, the reference answer and saved comments."""

    claim: dict[str, Any] | None
    reference: str | None = None
    rubric: list[dict[str, Any]]
    comments: list[dict[str, Any]]


class SecondMark(ResponseBody):
    """A second mark, and whether it agrees with the first. It does not show the first one's points."""

    submission_id: str
    points: float
    comment: str
    agrees: bool


IfMatch = Annotated[str | None, Header(max_length=255)]
DECIDING = refusals(401, 403, 404, 409, 412, 413, 422, 428, 429)


@router.get("/reviews", response_model=Page, responses=refusals(401, 403, 422, 429))
def list_reviews(
    query: Annotated[ReviewQuery, Query()], who: Instructor, services: AppServices, response: Response
) -> dict[str, Any]:
    """Lists the submissions that wait for a mark, oldest first; in anonymous quizzes under pseudonyms.

    An attempt does not wait while a newer one replaces it, unless the average counts. `second` lists what waits for
    the caller's second mark. `user` and `learner` find nothing in anonymous quizzes.
    """
    wanted = SubmissionFilter(who.course, query.user, query.quiz, query.question, query.learner)
    with services.database.read() as session:
        queue = reviews.list_queue(services.desk_of(who.course), session, wanted, who.id if query.second else None)
        waiting = stored.page(session, queue, query.start, query.limit + 1, now())
        shown = describe_for_reviewer(session, services, who, [submission for submission, _ in waiting])
    items = [{**view, "claim": describe_claim(claim)} for view, (_, claim) in zip(shown, waiting, strict=True)]
    return build_page(items, query, "/reviews", response)


@router.get("/reviews/disagreements", response_model=Page, responses=refusals(401, 403, 422, 429))
def list_disagreements(
    query: Annotated[QuestionQuery, Query()], who: Instructor, services: AppServices, response: Response
) -> dict[str, Any]:
    """Lists the submissions whose two marks differ by more than the tolerance, oldest first.

    `PUT /submissions/{id}/review` decides one, by who gave neither mark, or by anybody where the course has no other
    instructor. Until then the first mark counts.
    """
    wanted = SubmissionFilter(who.course, None, query.quiz, query.question)
    with services.database.read() as session:
        disagreements = stored.list_disagreements(session, wanted, query.start, query.limit + 1)
        shown = describe_for_reviewer(session, services, who, [submission for submission, _ in disagreements])
    items = [{**view, **both_marks(review)} for view, (_, review) in zip(shown, disagreements, strict=True)]
    return build_page(items, query, "/reviews/disagreements", response)


@router.post("/reviews:claim", response_model=ReviewView, responses=refusals(401, 403, 404, 409, 413, 422, 429))
def claim_review(body: ClaimBody, who: Instructor, services: AppServices, response: Response) -> dict[str, Any]:
    """Claims a submission for 15 minutes, so that no other instructor reviews it. 404 if none needs a review.

    Claiming again what one holds prolongs the claim.
    """
    desk = services.desk_of(who.course)
    with services.database.write() as session:
        desk.lock(session, who.course)
        if body.submission_id is not None:
            submission = find_visible(session, body.submission_id, who)
        else:
            wanted = SubmissionFilter(who.course, None, body.quiz, body.question)
            queue = reviews.list_queue(desk, session, wanted, who.id if body.second else None)
            submission = reviews.next_to_claim(session, queue, who)
        claim = reviews.claim(session, who, submission, second=body.second)
        (shown,) = describe_for_reviewer(session, services, who, [submission], with_answer=True)
        shown |= gather_helps(session, services, submission)
    response.headers["ETag"] = compute_etag(submission)
    return {**shown, "claim": describe_claim(claim)}


@router.post("/reviews:heartbeat", responses=refusals(401, 403, 404, 409, 413, 422, 429))
def prolong_claim(body: HeldBody, who: Instructor, services: AppServices) -> dict[str, Any]:
    """Prolongs the caller's claim to 15 minutes from now. 409 once it has ended."""
    with services.database.write() as session:
        services.desk_of(who.course).lock(session, who.course)
        return describe_claim(reviews.prolong(session, who, find_visible(session, body.submission_id, who))) or {}


@router.post("/reviews:release", status_code=204, responses=refusals(401, 403, 404, 413, 422, 429))
def release_claim(body: HeldBody, who: Instructor, services: AppServices) -> None:
    """Ends the caller's claim, if there is one."""
    with services.database.write() as session:
        services.desk_of(who.course).lock(session, who.course)
        reviews.release(session, who, find_visible(session, body.submission_id, who))


@router.post("/reviews:recompute", responses=refusals(401, 403, 404, 413, 422, 429))
def recompute_reviews(body: QuestionBody, who: Instructor, services: AppServices) -> dict[str, int]:
    """Computes the points of a question's reviews again from its rubric as it is now; returns how many changed.

    The service does so by itself whenever the content is loaded.
    """
    desk = services.desk_of(who.course)
    waiting = rubric_changes.list_outdated(desk, body.quiz, body.question, who.course)
    return {"changed": sum(rubric_changes.recompute(desk, submission, who) for submission in waiting)}


@router.get(
    "/submissions/{submission_id}/review", response_model=ReviewView, responses=refusals(401, 403, 404, 422, 429)
)
def show_review(submission_id: str, who: Instructor, services: AppServices, response: Response) -> dict[str, Any]:
    """Shows a submission as its reviewer sees it, without claiming it."""
    with services.database.read() as session:
        submission = find_visible(session, submission_id, who)
        (shown,) = describe_for_reviewer(session, services, who, [submission], with_answer=True)
        shown |= gather_helps(session, services, submission)
        claim = stored.find_claim(session, submission.id, now())
    response.headers["ETag"] = compute_etag(submission)
    return {**shown, "claim": describe_claim(claim)}


@router.put("/submissions/{submission_id}/review", response_model=SubmissionView, responses=DECIDING)
def put_review(
    submission_id: str,
    body: ReviewBody,
    who: Instructor,
    services: AppServices,
    response: Response,
    *,
    if_match: IfMatch = None,
) -> dict[str, Any]:
    """Adds the reviewer's verdict: its points count, and the learner sees the comment. Decides others' disagreement."""
    desk = services.desk_of(who.course)
    with services.database.write() as session:
        submission = find_visible(session, submission_id, who)
        desk.hold(session, submission)
        refuse_outdated(submission, if_match)
        reviews.decide(desk, session, who, submission, body.mark)
        session.flush()
        (shown,) = describe_for_reviewer(session, services, who, [submission], with_answer=True)
    response.headers["ETag"] = compute_etag(submission)
    return shown


@router.delete(
    "/submissions/{submission_id}/review", response_model=SubmissionView,
    responses=refusals(401, 403, 404, 409, 412, 422, 428, 429),
)  # fmt: skip
def withdraw_review(
    submission_id: str, who: Instructor, services: AppServices, response: Response, *, if_match: IfMatch = None
) -> dict[str, Any]:
    """Takes the marks back: the grader's own verdict counts again, and what only a person can grade waits again.

    Regrades no longer leave the submission out. 409 where no reviewer's mark counts.
    """
    desk = services.desk_of(who.course)
    with services.database.write() as session:
        submission = find_visible(session, submission_id, who)
        desk.hold(session, submission)
        refuse_outdated(submission, if_match)
        reviews.withdraw(desk, session, who, submission)
        session.flush()
        (shown,) = describe_for_reviewer(session, services, who, [submission], with_answer=True)
    response.headers["ETag"] = compute_etag(submission)
    return shown


@router.put("/submissions/{submission_id}/review/second", responses=DECIDING)
def put_second_mark(
    submission_id: str, body: ReviewBody, who: Instructor, services: AppServices, *, if_match: IfMatch = None
) -> SecondMark:
    """Keeps a second mark, which no learner sees; the first goes on counting. 409 unless one is waited for."""
    desk = services.desk_of(who.course)
    with services.database.write() as session:
        submission = find_visible(session, submission_id, who)
        desk.hold(session, submission)
        refuse_outdated(submission, if_match)
        review = reviews.mark_second(desk, session, who, submission, body.mark)
    agrees = review.second == stored.AGREED
    return SecondMark(
        submission_id=submission_id, points=review.second_points or 0.0, comment=body.mark.comment, agrees=agrees
    )


def describe_for_reviewer(
    session: Session, services: Services, who: Identity, rows: Sequence[Submission], *, with_answer: bool = False
) -> list[dict[str, Any]]:
    """Submissions as plain JSON for a reviewer, who sees neither names in anonymous quizzes nor the other's mark."""
    verdicts = submissions.read_verdicts(session, rows)
    seen = hide_names(services.desk_of(who.course), session, who, rows, verdicts, always=True)
    return [
        describe_submission(
            row, seen.verdicts.get(row.id), seen.names.get(row.id), with_answer=with_answer, with_seed=True
        )
        for row in rows
    ]


def gather_helps(session: Session, services: Services, submission: Submission) -> dict[str, Any]:
    """What helps a reviewer: the reference answer and the rubric, if the content still has them, and comments."""
    question = services.desk_of(submission.course).question(submission)
    at = (submission.course, submission.quiz, submission.question)
    return {
        "reference": None if question is None else kind_of(question).reference(question),
        "rubric": [] if question is None else [item.model_dump() for item in get_rubric(question)],
        "comments": [describe_comment(comment) for comment in find_comments(session, *at)],
    }


def refuse_outdated(submission: Submission, if_match: str | None) -> None:
    """Checks that the reviewer saw the newest state. Raises Unconditional, Outdated."""
    if if_match is None:
        raise Unconditional("Send If-Match with the ETag of the submission that you review.")
    if not is_current(submission, if_match):
        raise Outdated(CHANGED)


def describe_claim(claim: ReviewClaim | None) -> dict[str, Any] | None:
    """The reviewer who holds a submission, and until when."""
    return None if claim is None else {"by": claim.name, "expires_at": claim.expires_at}


def both_marks(review: Review) -> dict[str, Any]:
    """The two marks of a disagreement; the first one's items and comment are in the verdict."""
    ticked = None if review.second_ticked is None else json.loads(review.second_ticked)
    second = {"by": review.second_name, "points": review.second_points, "comment": review.second_comment}
    return {"first": {"by": review.name, "points": review.points}, "second": second | {"rubric": ticked}}
