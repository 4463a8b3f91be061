"""Every query on submissions, their verdicts and their events."""

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import ColumnElement, bindparam, case, func, insert, literal, select
from sqlalchemy.orm import Session

from grader.domain.policy import Progress
from grader.domain.verdict import Status, Verdict
from grader.metrics import VERDICTS
from grader.store.rows import insert_rows
from grader.store.signals import announce
from grader.store.tables import Event, Submission, UtcDateTime, VerdictRow, now, values_of

QUEUED, RUNNING, GRADED, NEEDS_REVIEW = "queued", "running", "graded", "needs_review"
AT_REST = (GRADED, NEEDS_REVIEW)

NEW = {"status": QUEUED, "uses_attempt": True, "outcome": None, "revision": 0}
"""The state of a submission that waits for its first verdict."""

EVENTS = "events"
"""The channel on which new events are announced, by submission."""


@dataclass(frozen=True)
class SubmissionFilter:
    """Selects submissions by course, name of the user, quiz, question and learner's id; None matches any."""

    course: str
    user: str | None = None
    quiz: str | None = None
    question: str | None = None
    learner: str | None = None

    def conditions(self) -> list[ColumnElement[bool]]:
        """The filter as SQL conditions."""
        return [getattr(Submission, name) == value for name, value in vars(self).items() if value is not None]


def add(session: Session, new: Sequence[tuple[Submission, Verdict | None]]) -> None:
    """Inserts new submissions: as graded with its verdict, or as queued without one; one statement for each table."""
    clock = now()
    for submission, verdict in new:
        state = NEW if verdict is None else _settled(verdict, 1)
        vars(submission).update(state, version=1, created_at=clock)
    insert_rows(session, Submission, [values_of(submission) for submission, _ in new])
    made = [_verdict_values(submission, verdict, "grading") for submission, verdict in new if verdict is not None]
    insert_rows(session, VerdictRow, made)
    insert_rows(session, Event, [{"submission_id": one.id, "number": 1, "name": one.status} for one, _ in new])


def append_verdict(
    session: Session, submission: Submission, verdict: Verdict, cause: str, reviewer: str | None = None
) -> None:
    """Adds a verdict as the submission's newest revision; earlier ones stay as they are."""
    for name, value in _settled(verdict, submission.revision + 1).items():
        setattr(submission, name, value)
    session.add(VerdictRow(**_verdict_values(submission, verdict, cause), reviewer=reviewer))
    _add_event(session, submission)


def get(session: Session, submission_id: str) -> Submission | None:
    """The submission, if there is one."""
    return session.get(Submission, submission_id)


def several(session: Session, ids: Sequence[str]) -> Sequence[Submission]:
    """The submissions with these ids, as they are in the database now."""
    found = select(Submission).where(Submission.id.in_(ids)).execution_options(populate_existing=True)
    return session.scalars(found).all()


def start(session: Session, submission_id: str) -> Submission:
    """Marks the submission as running."""
    return _change_status(session, submission_id, RUNNING)


def put_back(session: Session, submission_id: str) -> Submission:
    """Marks the submission as queued again, after a try that failed through our fault."""
    return _change_status(session, submission_id, QUEUED)


def page(session: Session, wanted: SubmissionFilter, before: str | None, limit: int) -> Sequence[Submission]:
    """At most `limit` submissions, newest first, that are older than `before`."""
    newest_first = select(Submission).where(*wanted.conditions()).order_by(Submission.id.desc()).limit(limit)
    if before is not None:
        newest_first = newest_first.where(Submission.id < before)
    return session.scalars(newest_first).all()


def newest(session: Session, course: str, learner: str) -> Sequence[Submission]:
    """A learner's newest submission at each question; answers that could not be read are left out."""
    readable = Submission.outcome.is_(None) | (Submission.outcome != Status.INVALID_ANSWER.value)
    theirs = (Submission.course == course, Submission.learner == learner, readable)
    ids = select(func.max(Submission.id)).where(*theirs).group_by(Submission.quiz, Submission.question)
    return session.scalars(select(Submission).where(Submission.id.in_(ids))).all()


THEIRS = (Submission.course == bindparam("course"), Submission.learner == bindparam("learner"), Submission.uses_attempt)
PROGRESS = (
    select(
        Submission.quiz,
        Submission.question,
        func.count(),
        func.sum(case((Submission.outcome.is_(None), 1), else_=0)),
        func.max(case((Submission.outcome == Status.CORRECT.value, 1), else_=0)),
    )
    .where(*THEIRS)
    .group_by(Submission.quiz, Submission.question)
)
PROGRESS_AT = PROGRESS.where(Submission.quiz == bindparam("quiz"), Submission.question == bindparam("question"))


def progress_at(session: Session, course: str, learner: str, quiz: str, question: str) -> Progress:
    """What a learner's attempts at one question come to; queued ones count."""
    where = {"course": course, "learner": learner, "quiz": quiz, "question": question}
    found = session.connection().execute(PROGRESS_AT, where).first()
    return Progress() if found is None else Progress(found[2], found[3], bool(found[4]))


def progress(session: Session, course: str, learner: str) -> dict[tuple[str, str], Progress]:
    """What a learner's attempts come to, by (quiz, question); questions without an attempt are left out."""
    found = session.connection().execute(PROGRESS, {"course": course, "learner": learner})
    return {(row[0], row[1]): Progress(row[2], row[3], bool(row[4])) for row in found}


def pending(session: Session, wanted: SubmissionFilter) -> int:
    """The number of submissions without a verdict."""
    waiting = select(func.count()).select_from(Submission).where(*wanted.conditions())
    return session.scalar(waiting.where(Submission.status.in_((QUEUED, RUNNING)))) or 0


def verdicts(session: Session, submissions: Iterable[Submission]) -> dict[str, Any]:
    """The newest verdict of each submission as plain JSON, by id; submissions without one are left out."""
    same = (VerdictRow.submission_id == Submission.id) & (VerdictRow.revision == Submission.revision)
    bodies = select(VerdictRow.submission_id, VerdictRow.body).join(Submission, same)
    wanted = bodies.where(Submission.id.in_([submission.id for submission in submissions]))
    return {submission_id: json.loads(body) for submission_id, body in session.execute(wanted)}


def events_after(session: Session, submission_id: str, number: int) -> Sequence[Event]:
    """The submission's events after event `number`, in order."""
    later = select(Event).where(Event.submission_id == submission_id, Event.number > number)
    return session.scalars(later.order_by(Event.number)).all()


def last_event(session: Session, submission_id: str) -> int:
    """The number of the submission's newest event; 0 if there is none."""
    return session.scalar(select(func.max(Event.number)).where(Event.submission_id == submission_id)) or 0


def _change_status(session: Session, submission_id: str, status: str) -> Submission:
    submission = session.get_one(Submission, submission_id)
    submission.status = status
    _add_event(session, submission)
    return submission


def _settled(verdict: Verdict, revision: int) -> dict[str, Any]:
    VERDICTS.labels(verdict.status.value).inc()
    return {
        "status": NEEDS_REVIEW if verdict.status is Status.NEEDS_REVIEW else GRADED,
        "uses_attempt": verdict.status.uses_attempt,
        "outcome": verdict.status.value,
        "revision": revision,
    }


def _verdict_values(submission: Submission, verdict: Verdict, cause: str) -> dict[str, Any]:
    return {
        "submission_id": submission.id,
        "revision": submission.revision,
        "cause": cause,
        "status": verdict.status.value,
        "points": verdict.points,
        "max_points": verdict.max_points,
        "course": submission.course,
        "seed": submission.seed,
        "content_digest": verdict.content_digest,
        "body": verdict.model_dump_json(),
    }


def _add_event(session: Session, submission: Submission) -> None:
    """Adds the submission's new status as an event, and announces it."""
    session.flush()
    number = 1 + func.coalesce(func.max(Event.number), 0)
    values = (literal(submission.id), number, literal(submission.status), literal(now(), UtcDateTime))
    added = select(*values).where(Event.submission_id == submission.id)
    session.execute(insert(Event).from_select(["submission_id", "number", "name", "created_at"], added))
    announce(session, EVENTS, submission.id)
