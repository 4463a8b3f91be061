"""Every query on submissions and their verdicts."""

import json
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from datetime import datetime
from functools import cache
from typing import Any, NamedTuple

from prometheus_client import Counter
from sqlalchemy import (
    ColumnElement,
    SQLColumnExpression,
    bindparam,
    case,
    func,
    literal_column,
    select,
    tuple_,
)
from sqlalchemy.orm import Session

from grader.domain.policy import Progress
from grader.domain.progress import TrialProgress
from grader.domain.verdict import Status, Verdict
from grader.metrics import VERDICTS
from grader.store.engine.bulk import TableRows, insert_rows
from grader.store.engine.ids import first_id
from grader.store.events import add_event, name_case
from grader.store.tables import Base, Event, Member, Review, Submission, VerdictRow, now

QUEUED, RUNNING, GRADED, NEEDS_REVIEW = "queued", "running", "graded", "needs_review"
AT_REST = (GRADED, NEEDS_REVIEW)

STOP = "stop"
"""The cause of the verdict on a script that its learner stopped. As a reviewer's, it stays when others are regraded."""

REVIEW, WITHDRAWN = "review", "withdrawn"
"""The causes of a reviewer's verdict, and of the grader's own that counts again after a reviewer took the mark back."""

UNSETTLED = Submission.status != literal_column("'graded'")
"""The condition of the index of submissions that wait for a verdict or a person. Queries for these have it too."""

NEW = {"status": QUEUED, "uses_attempt": True, "outcome": None, "revision": 0}
"""The state of a submission that waits for its first verdict."""

NEWEST = (VerdictRow.submission_id == Submission.id) & (VerdictRow.revision == Submission.revision)
"""Joins a submission with its newest verdict."""


READABLE = Submission.outcome.is_(None) | (Submission.outcome != Status.INVALID_ANSWER.value)
"""The condition of answers that could be read, or are still to be."""


class Try(NamedTuple):
    """A graded attempt of a member at a question."""

    learner: str
    name: str
    quiz: str
    question: str
    submission: str
    created_at: datetime
    points: float


class VerdictMark(NamedTuple):
    """A verdict in short: what caused it (as in `VerdictRow`), its status, its points and when it was given."""

    cause: str
    status: str
    points: float
    max_points: float
    at: datetime


class AttemptMark(NamedTuple):
    """An attempt in short: its number, its state, and the newest verdict's status and points, None before the first."""

    id: str
    attempt: int
    at: datetime
    state: str
    status: str | None
    points: float | None
    max_points: float | None


@dataclass(frozen=True)
class SubmissionFilter:
    """Selects submissions by course, the name that their member has now, quiz, question and learner's id; None matches
    any."""

    course: str
    user: str | None = None
    quiz: str | None = None
    question: str | None = None
    learner: str | None = None

    def conditions(self) -> list[ColumnElement[bool]]:
        """The filter as SQL conditions."""
        columns = {name: value for name, value in vars(self).items() if value is not None and name != "user"}
        conditions = [getattr(Submission, name) == value for name, value in columns.items()]
        if self.user is not None:
            named = select(Member.id).where(Member.course == self.course, Member.name == self.user)
            conditions.append(Submission.learner.in_(named))
        return conditions


def make(**columns: Any) -> Submission:
    """A new submission with these columns, for `add`. It is made as if it had been read: to set the columns of a mapped
    object one by one takes ten times as long."""
    submission: Submission = Submission.__mapper__.class_manager.new_instance()
    vars(submission).update(columns)
    return submission


def add(session: Session, new: Sequence[tuple[Submission, Verdict | None]], clock: datetime | None = None) -> None:
    """Inserts new submissions: as graded with its verdict, or as queued without one. The objects get their state, and
    are not followed by the session."""
    insert_rows(session, *settle(new, clock or now()))


def settle(new: Sequence[tuple[Submission, Verdict | None]], clock: datetime) -> list[TableRows]:
    """Gives new submissions their state. Returns the rows to be inserted of them, their verdicts and their events."""
    for submission, verdict in new:
        vars(submission).update(version=1, created_at=clock, **NEW if verdict is None else _settled(verdict, 1))
    graded = [(submission, verdict) for submission, verdict in new if verdict is not None]
    return [
        (Submission, [read_values(submission) for submission, _ in new]),
        (VerdictRow, [_verdict_values(*pair, "grading") | {"created_at": clock} for pair in graded]),
        (Event, [{"submission_id": row.id, "number": 1, "name": row.status, "created_at": clock} for row, _ in new]),
    ]


def read_values(row: Base) -> dict[str, Any]:
    """The columns that are set on a row."""
    return {name: value for name, value in vars(row).items() if not name.startswith("_")}


def append_verdict(
    session: Session, submission: Submission, verdict: Verdict, cause: str, reviewer: str | None = None
) -> None:
    """Adds a verdict as the submission's newest revision; earlier ones stay as they are."""
    for name, value in _settled(verdict, submission.revision + 1).items():
        setattr(submission, name, value)
    session.add(VerdictRow(**_verdict_values(submission, verdict, cause), reviewer=reviewer))
    session.flush()
    add_event(session, submission.id, submission.status)


def get(session: Session, submission_id: str) -> Submission | None:
    """The submission, if there is one."""
    return session.get(Submission, submission_id)


def get_several(session: Session, ids: Sequence[str]) -> Sequence[Submission]:
    """The submissions with these ids, as they are in the database now."""
    query = select(Submission).where(Submission.id.in_(ids)).execution_options(populate_existing=True)
    return session.scalars(query).all()


def start(session: Session, submission_id: str) -> Submission:
    """Marks the submission as running."""
    return _change_status(session, submission_id, RUNNING)


def put_back(session: Session, submission_id: str) -> Submission:
    """Marks the submission as queued again, after a try that failed through our fault."""
    return _change_status(session, submission_id, QUEUED)


def tell_case(session: Session, submission_id: str, case: int, cases: int, within: TrialProgress | None = None) -> None:
    """Adds an event that tells which case a running script is at, and how far in it; nothing if it does not run any
    more."""
    submission = session.get(Submission, submission_id, with_for_update=True)
    if submission is not None and submission.status == RUNNING:
        add_event(session, submission_id, name_case(case, cases, within))


def page(session: Session, wanted: SubmissionFilter, before: str | None, limit: int) -> Sequence[Submission]:
    """At most `limit` submissions, newest first, that are older than `before`."""
    # Those of one learner are few. In the order of the plain column SQLite would look for them in the whole course.
    is_one = wanted.learner is not None or wanted.user is not None
    order = Submission.id.concat("") if is_one else Submission.id
    newest_first = select(Submission).where(*wanted.conditions()).order_by(order.desc()).limit(limit)
    if before is not None:
        newest_first = newest_first.where(order < before)
    return session.scalars(newest_first).all()


def list_attempt_marks(session: Session, wanted: SubmissionFilter) -> list[AttemptMark]:
    """The attempts of a learner at a question in short, newest first; answers that could not be read are left out."""
    columns = (Submission.id, Submission.attempt, Submission.created_at, Submission.status)
    rows = (
        select(*columns, VerdictRow.status, VerdictRow.points, VerdictRow.max_points)
        .outerjoin(VerdictRow, NEWEST)
        .where(*wanted.conditions(), READABLE)
        .order_by(Submission.id.concat("").desc())  # as in `page`
    )
    return [AttemptMark(*row) for row in session.execute(rows)]


def find_newest_quiz(session: Session, course: str) -> str | None:
    """The quiz of the newest submission of a course; None before the first."""
    here = select(Submission.quiz).where(Submission.course == course)
    return session.scalar(here.order_by(Submission.id.desc()).limit(1))


def find_newest(session: Session, course: str, learner: str) -> Sequence[Submission]:
    """A learner's newest submission at each question; answers that could not be read are left out."""
    theirs = (Submission.course == course, Submission.learner == learner, READABLE)
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


def compute_progress_at(session: Session, course: str, learner: str, quiz: str, question: str) -> Progress:
    """What a learner's attempts at one question come to; queued ones count."""
    where = {"course": course, "learner": learner, "quiz": quiz, "question": question}
    row = session.connection().execute(PROGRESS_AT, where).first()
    return Progress() if row is None else Progress(row[2], row[3], bool(row[4]))


def compute_progress(session: Session, course: str, learner: str) -> dict[tuple[str, str], Progress]:
    """What a learner's attempts come to, by (quiz, question); questions without an attempt are left out."""
    rows = session.connection().execute(PROGRESS, {"course": course, "learner": learner})
    return {(row[0], row[1]): Progress(row[2], row[3], bool(row[4])) for row in rows}


def find_unsolved(
    session: Session, course: str, since: datetime, attempts: int, *, newest: int, limit: int
) -> Sequence[Try]:
    """The graded attempts since a moment at questions where a member has made that many and none was right, in order.
    Among the `newest` submissions of the course, and of at most `limit` learners at a question, who tried last. Leaves
    out what a person marks, and who was removed."""
    graded = _graded_since(session, course, since, newest)
    right = func.max(case((Submission.outcome == Status.CORRECT.value, 1), else_=0))
    at = (Submission.learner, Submission.quiz, Submission.question)
    places = select(*at).where(*graded).group_by(*at).having(func.count() >= attempts, right == 0)
    last = places.order_by(func.max(Submission.id).desc()).limit(limit).subquery()
    rows = (
        select(Submission.learner, Member.name, *at[1:], Submission.id, Submission.created_at, VerdictRow.points)
        .join(Member, (Member.id == Submission.learner) & Member.removed_at.is_(None))
        .join(VerdictRow, NEWEST)
        .where(*graded, tuple_(*at).in_(select(last)))
        .order_by(*at, Submission.id)
    )
    return [Try(*row) for row in session.execute(rows)]


def newest_wrong(
    session: Session, course: str, since: datetime, *, newest: int, limit: int
) -> list[tuple[str, str, str, str]]:
    """Learner, quiz, question and submission of at most `limit` attempts that are a learner's newest at a question, the
    newest first. Otherwise as `find_unsolved`: since a moment, none right, and no instructor's."""
    graded = _graded_since(session, course, since, newest)
    right = func.max(case((Submission.outcome == Status.CORRECT.value, 1), else_=0))
    at = (Submission.learner, Submission.quiz, Submission.question)
    last = func.max(Submission.id)
    is_learner = (Member.id == Submission.learner) & (Member.role == "student") & Member.removed_at.is_(None)
    places = select(*at, last).join(Member, is_learner).where(*graded).group_by(*at).having(right == 0)
    return [(row[0], row[1], row[2], row[3]) for row in session.execute(places.order_by(last.desc()).limit(limit))]


def _graded_since(session: Session, course: str, since: datetime, newest: int) -> Sequence[SQLColumnExpression[bool]]:
    """The conditions of attempts that have a verdict of the grader's own, among the newest of a course."""
    is_marked = select(Review.submission_id).where(Review.submission_id == Submission.id).exists()
    oldest = _oldest(session, course, since, newest)
    recent = (Submission.course == course, Submission.id >= oldest, Submission.uses_attempt)
    return (*recent, Submission.status == GRADED, ~is_marked)


def _oldest(session: Session, course: str, since: datetime, newest: int) -> str:
    """The least id among the `newest` submissions of a course and since a moment."""
    here = select(Submission.id).where(Submission.course == course).order_by(Submission.id.desc())
    return max(first_id(since), session.scalar(here.offset(newest - 1).limit(1)) or "")


def count_outcomes(session: Session, course: str, since: datetime, newest: int) -> dict[str, int]:
    """How many of the submissions of a course since a moment have which status of a verdict; of the `newest` ones."""
    recent = (Submission.course == course, Submission.id >= _oldest(session, course, since, newest))
    graded = (*recent, Submission.outcome.is_not(None))
    counts = select(Submission.outcome, func.count()).where(*graded).group_by(Submission.outcome)
    return {str(row[0]): row[1] for row in session.execute(counts)}


def list_graded(
    session: Session, wanted: SubmissionFilter, without: Collection[str], limit: int
) -> list[tuple[Submission, str]]:
    """At most `limit` attempts that have their verdict, the newest ones in the order of time, each with its newest
    verdict as JSON text; not those of the learners `without`."""
    theirs = (Submission.uses_attempt, Submission.status.in_(AT_REST), Submission.learner.not_in(without))
    rows = select(Submission, VerdictRow.body).join(VerdictRow, NEWEST).where(*wanted.conditions(), *theirs)
    newest = session.execute(rows.order_by(Submission.id.desc()).limit(limit)).all()
    return [(row, body) for row, body in reversed(newest)]


def count_pending(session: Session, wanted: SubmissionFilter) -> int:
    """The number of submissions without a verdict."""
    waiting = select(func.count()).select_from(Submission).where(*wanted.conditions())
    return session.scalar(waiting.where(UNSETTLED, Submission.status.in_((QUEUED, RUNNING)))) or 0


def read_verdicts(session: Session, submissions: Iterable[Submission]) -> dict[str, Any]:
    """The newest verdict of each submission as plain JSON, by id; submissions without one are left out."""
    return read_verdicts_by_id(session, [submission.id for submission in submissions])


BODIES = (
    select(VerdictRow.submission_id, VerdictRow.body)
    .join(Submission, NEWEST)
    .where(Submission.id.in_(bindparam("ids", expanding=True)))
)


def read_verdicts_by_id(session: Session, ids: Iterable[str]) -> dict[str, Any]:
    """As `read_verdicts`, for the ids of submissions."""
    result = session.execute(BODIES, {"ids": list(ids)})
    return {submission_id: json.loads(body) for submission_id, body in result}


def last_marks(session: Session, submissions: Iterable[Submission]) -> dict[str, tuple[VerdictMark, VerdictMark]]:
    """The last verdict but one and the last one in short, by submission; those with one verdict are left out."""
    regraded = [submission.id for submission in submissions if submission.revision > 1]
    if not regraded:
        return {}
    marks = (getattr(VerdictRow, name) for name in ("cause", "status", "points", "max_points", "created_at"))
    rows = (
        select(VerdictRow.submission_id, *marks)
        .join(Submission, Submission.id == VerdictRow.submission_id)
        .where(Submission.id.in_(regraded), VerdictRow.revision >= Submission.revision - 1)
        .order_by(VerdictRow.submission_id, VerdictRow.revision)
    )
    by_submission: dict[str, list[VerdictMark]] = {}
    for submission_id, *mark in session.execute(rows):
        by_submission.setdefault(submission_id, []).append(VerdictMark(*mark))
    return {submission_id: (pair[0], pair[1]) for submission_id, pair in by_submission.items()}


def _change_status(session: Session, submission_id: str, status: str) -> Submission:
    submission = session.get_one(Submission, submission_id)
    submission.status = status
    session.flush()
    add_event(session, submission_id, status)
    return submission


@cache
def get_counter(status: Status) -> Counter:
    """Returns the metric of such verdicts; looked up once, since for Prometheus that takes longer than to count."""
    return VERDICTS.labels(status.value)


def _settled(verdict: Verdict, revision: int) -> dict[str, Any]:
    get_counter(verdict.status).inc()
    return {
        "status": NEEDS_REVIEW if verdict.status is Status.NEEDS_REVIEW else GRADED,
        "uses_attempt": verdict.status.uses_attempt,
        "outcome": verdict.status.value,
        "revision": revision,
    }


def _verdict_values(submission: Submission, verdict: Verdict, cause: str) -> dict[str, Any]:
    return {
        "submission_id": submission.id, "revision": submission.revision, "cause": cause, "status": verdict.status.value,
        "points": verdict.points, "max_points": verdict.max_points, "course": submission.course,
        "seed": submission.seed, "content_digest": verdict.content_digest, "body": verdict.model_dump_json(),
    }  # fmt: skip
