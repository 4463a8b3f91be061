"""Every query on submissions that need a review, and on the claims on them."""

from collections.abc import Sequence
from datetime import datetime

from sqlalchemy import ColumnElement, select
from sqlalchemy.orm import Session

from grader.store.submissions import NEEDS_REVIEW, SubmissionFilter
from grader.store.tables import ReviewClaim, Submission

Waiting = tuple[Submission, ReviewClaim | None]


def page(
    session: Session, wanted: SubmissionFilter, after: str | None, limit: int, clock: datetime
) -> Sequence[Waiting]:
    """At most `limit` submissions that need a review, oldest first, beginning after the id `after`."""
    oldest_first = (
        select(Submission, ReviewClaim).outerjoin(ReviewClaim, _holds_at(clock)).where(*_needs_review(wanted))
    )
    if after is not None:
        oldest_first = oldest_first.where(Submission.id > after)
    return [(row[0], row[1]) for row in session.execute(oldest_first.order_by(Submission.id).limit(limit))]


def oldest(session: Session, wanted: SubmissionFilter, reviewer: str, clock: datetime) -> Submission | None:
    """The oldest submission without a claim, else the oldest that this reviewer has claimed."""
    waiting = select(Submission).outerjoin(ReviewClaim, _holds_at(clock)).where(*_needs_review(wanted))
    longest = waiting.order_by(Submission.id).limit(1)
    free = session.scalar(longest.where(ReviewClaim.submission_id.is_(None)))
    return free or session.scalar(longest.where(ReviewClaim.reviewer == reviewer))


def claim_on(session: Session, submission_id: str, clock: datetime) -> ReviewClaim | None:
    """The claim on the submission, if one still holds."""
    claim = session.get(ReviewClaim, submission_id)
    return claim if claim is not None and claim.expires_at > clock else None


def put_claim(session: Session, submission_id: str, reviewer: str, expires_at: datetime) -> ReviewClaim:
    """Gives the submission to a reviewer until `expires_at`; replaces any earlier claim."""
    return session.merge(ReviewClaim(submission_id=submission_id, reviewer=reviewer, expires_at=expires_at))


def drop_claim(session: Session, submission_id: str) -> None:
    """Deletes the claim on the submission, if there is one."""
    if claim := session.get(ReviewClaim, submission_id):
        session.delete(claim)


def _needs_review(wanted: SubmissionFilter) -> list[ColumnElement[bool]]:
    return [*wanted.conditions(), Submission.status == NEEDS_REVIEW]


def _holds_at(clock: datetime) -> ColumnElement[bool]:
    return (ReviewClaim.submission_id == Submission.id) & (ReviewClaim.expires_at > clock)
