"""Every query on what waits for a person, and on who has taken it up."""

from collections.abc import Sequence
from datetime import datetime

from sqlalchemy import ColumnElement, select
from sqlalchemy.orm import Session

from grader.store.submissions import NEEDS_REVIEW, Chosen
from grader.store.tables import ReviewClaim, Submission

Waiting = tuple[Submission, ReviewClaim | None]


def page(session: Session, chosen: Chosen, after: str | None, limit: int, clock: datetime) -> Sequence[Waiting]:
    """At most `limit` submissions that wait for a review and are younger than `after`, oldest first."""
    oldest_first = select(Submission, ReviewClaim).outerjoin(ReviewClaim, _holds(clock)).where(*_waits(chosen))
    if after is not None:
        oldest_first = oldest_first.where(Submission.id > after)
    return [(row[0], row[1]) for row in session.execute(oldest_first.order_by(Submission.id).limit(limit))]


def oldest(session: Session, chosen: Chosen, reviewer: str, clock: datetime) -> Submission | None:
    """The one that has waited longest among those that nobody holds, else among the reviewer's own."""
    waiting = select(Submission).outerjoin(ReviewClaim, _holds(clock)).where(*_waits(chosen))
    longest = waiting.order_by(Submission.id).limit(1)
    free = session.scalar(longest.where(ReviewClaim.submission_id.is_(None)))
    return free or session.scalar(longest.where(ReviewClaim.reviewer == reviewer))


def claim_on(session: Session, submission_id: str, clock: datetime) -> ReviewClaim | None:
    """Who is reviewing the submission, if anybody still is."""
    claim = session.get(ReviewClaim, submission_id)
    return claim if claim is not None and claim.expires_at > clock else None


def put_claim(session: Session, submission_id: str, reviewer: str, expires_at: datetime) -> ReviewClaim:
    """The submission is the reviewer's until then; whoever had it has it no more."""
    return session.merge(ReviewClaim(submission_id=submission_id, reviewer=reviewer, expires_at=expires_at))


def drop_claim(session: Session, submission_id: str) -> None:
    """Nobody is reviewing the submission any more."""
    if claim := session.get(ReviewClaim, submission_id):
        session.delete(claim)


def _waits(chosen: Chosen) -> list[ColumnElement[bool]]:
    return [*chosen.conditions(), Submission.status == NEEDS_REVIEW]


def _holds(clock: datetime) -> ColumnElement[bool]:
    return (ReviewClaim.submission_id == Submission.id) & (ReviewClaim.expires_at > clock)
