"""Every query on submissions, their verdicts and their events."""

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import ColumnElement, bindparam, func, select
from sqlalchemy.orm import Session

from grader.domain.verdict import Status, Verdict
from grader.store.tables import Event, IdempotencyKey, Submission, VerdictRow, insert_row, now

QUEUED, RUNNING, GRADED, NEEDS_REVIEW = "queued", "running", "graded", "needs_review"
AT_REST = (GRADED, NEEDS_REVIEW)


@dataclass(frozen=True)
class Chosen:
    """Which submissions are meant; None means any."""

    course: str
    user: str | None = None
    quiz: str | None = None
    question: str | None = None

    def conditions(self) -> list[ColumnElement[bool]]:
        """As SQL."""
        return [getattr(Submission, name) == value for name, value in vars(self).items() if value is not None]


def add(session: Session, submission: Submission, verdict: Verdict | None) -> None:
    """Keeps a new submission: with its verdict where there is one already, else as queued.

    Every answer comes through here: plain inserts take a third of the time that the session's unit of work takes.
    """
    submission.status, submission.uses_attempt, submission.revision, submission.version = QUEUED, True, 0, 1
    submission.created_at = now()
    if verdict is not None:
        _settle(submission, verdict)
    insert_row(session, submission)
    if verdict is not None:
        insert_row(session, _verdict_row(submission, verdict, "grading"))
    insert_row(session, Event(submission_id=submission.id, number=1, name=submission.status))


def append_verdict(
    session: Session, submission: Submission, verdict: Verdict, cause: str, reviewer: str | None = None
) -> None:
    """Adds a verdict as the submission's newest revision; earlier ones stay as they are."""
    _settle(submission, verdict)
    row = _verdict_row(submission, verdict, cause)
    row.reviewer = reviewer
    session.add(row)
    _note(session, submission)


def get(session: Session, submission_id: str) -> Submission | None:
    """The submission, if there is one."""
    return session.get(Submission, submission_id)


def start(session: Session, submission_id: str) -> Submission:
    """A worker has taken the submission up."""
    return _turn(session, submission_id, RUNNING)


def put_back(session: Session, submission_id: str) -> Submission:
    """The submission waits once more: a try at grading it failed through our fault."""
    return _turn(session, submission_id, QUEUED)


def page(session: Session, chosen: Chosen, before: str | None, limit: int) -> Sequence[Submission]:
    """At most `limit` submissions, newest first, that are older than `before`."""
    newest_first = select(Submission).where(*chosen.conditions()).order_by(Submission.id.desc()).limit(limit)
    if before is not None:
        newest_first = newest_first.where(Submission.id < before)
    return session.scalars(newest_first).all()


ATTEMPTS_AT = select(func.count()).where(
    Submission.course == bindparam("course"),
    Submission.user == bindparam("user"),
    Submission.quiz == bindparam("quiz"),
    Submission.question == bindparam("question"),
    Submission.uses_attempt,
)


def attempts_at(session: Session, one: Chosen) -> int:
    """How many attempts a learner has used up on one question; those still in the queue are counted."""
    return session.connection().execute(ATTEMPTS_AT, vars(one)).scalar_one()


def attempts_used(session: Session, chosen: Chosen) -> dict[str, int]:
    """How many attempts are used up, by question; those still in the queue are counted."""
    used = select(Submission.question, func.count()).where(*chosen.conditions(), Submission.uses_attempt)
    return dict(session.execute(used.group_by(Submission.question)).all())


def pending(session: Session, chosen: Chosen) -> int:
    """How many submissions still wait for their verdict."""
    waiting = select(func.count()).select_from(Submission).where(*chosen.conditions())
    return session.scalar(waiting.where(Submission.status.in_((QUEUED, RUNNING)))) or 0


def verdicts(session: Session, submissions: Iterable[Submission]) -> dict[str, Any]:
    """The verdict that counts of each submission as plain JSON; those without one are left out."""
    same = (VerdictRow.submission_id == Submission.id) & (VerdictRow.revision == Submission.revision)
    bodies = select(VerdictRow.submission_id, VerdictRow.body).join(Submission, same)
    chosen = bodies.where(Submission.id.in_([submission.id for submission in submissions]))
    return {submission_id: json.loads(body) for submission_id, body in session.execute(chosen)}


def events_after(session: Session, submission_id: str, number: int) -> Sequence[Event]:
    """The submission's events after the `number`-th, in order."""
    later = select(Event).where(Event.submission_id == submission_id, Event.number > number)
    return session.scalars(later.order_by(Event.number)).all()


def last_event(session: Session, submission_id: str) -> int:
    """The number of the submission's newest event; 0 where there is none."""
    return session.scalar(select(func.max(Event.number)).where(Event.submission_id == submission_id)) or 0


def find_key(session: Session, course: str, user: str, key: str) -> IdempotencyKey | None:
    """What a learner's earlier request with this key made, if there was one."""
    return session.get(IdempotencyKey, (course, user, key))


def _turn(session: Session, submission_id: str, status: str) -> Submission:
    submission = session.get_one(Submission, submission_id)
    submission.status = status
    _note(session, submission)
    return submission


def _settle(submission: Submission, verdict: Verdict) -> None:
    submission.status = NEEDS_REVIEW if verdict.status is Status.NEEDS_REVIEW else GRADED
    submission.uses_attempt = verdict.status.uses_attempt
    submission.revision += 1


def _verdict_row(submission: Submission, verdict: Verdict, cause: str) -> VerdictRow:
    return VerdictRow(
        submission_id=submission.id,
        revision=submission.revision,
        cause=cause,
        status=verdict.status.value,
        points=verdict.points,
        max_points=verdict.max_points,
        course=submission.course,
        seed=submission.seed,
        content_digest=verdict.content_digest,
        body=verdict.model_dump_json(),
    )


def _note(session: Session, submission: Submission) -> None:
    """Adds the submission's new status as an event."""
    number = 1 + last_event(session, submission.id)
    session.add(Event(submission_id=submission.id, number=number, name=submission.status))
