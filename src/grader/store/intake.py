"""What is stored about new answers: all that deciding on them and counting them takes, in one query."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import datetime
from functools import cache
from typing import Any, NamedTuple

from sqlalchemy import Select, and_, bindparam, case, delete, exists, func, select
from sqlalchemy.orm import Session

from grader.domain.policy import Extension, Progress
from grader.domain.verdict import Status
from grader.store.credentials import is_alive
from grader.store.engine.bulk import UtcDateTime, keys_table, read_by_keys
from grader.store.outbox import Destination
from grader.store.policies import PolicyChange
from grader.store.results import Columns, LearnerAt
from grader.store.submissions import NEWEST
from grader.store.tables import Credential, ExtensionRow, IdempotencyKey, Publication, Result, Submission, VerdictRow


class SourceAttempt(NamedTuple):
    """The attempt that a result comes from, with the points of its newest verdict."""

    id: str
    attempt: int
    created_at: datetime
    outcome: str | None
    points: float | None


@dataclass
class QuestionState:
    """What is stored of a learner at a question; intake brings it up to date with every answer that it takes."""

    progress: Progress = field(default_factory=Progress)
    newest_id: str = ""
    """The id of the newest attempt; empty without one."""
    result: Columns | None = None
    """The columns of the result."""
    source: SourceAttempt | None = None
    extension: Extension | None = None
    published_at: datetime | None = None
    """When the feedback of the quiz was published."""
    changes: str | None = None
    """What the course has changed in the policy of the quiz, as JSON text."""
    has_destinations: bool = False
    """Whether changes of results of the course are delivered anywhere."""


class EarlierRequest(NamedTuple):
    """What the first request with an idempotency key has made."""

    request_digest: str
    submission_id: str
    http_status: int


class AnswerKeys(NamedTuple):
    """What a new answer is looked up by: its learner and question, its credential, and its idempotency key, if any."""

    place: LearnerAt
    credential: str = ""
    key: str | None = None


class StoredOfAnswer(NamedTuple):
    """What is stored about one new answer."""

    is_live: bool
    """Whether its credential has neither ended nor been revoked, and its member has its role."""
    state: QuestionState
    earlier: EarlierRequest | None


NAMES = (*LearnerAt._fields, "credential", "key")


def read(session: Session, answers: Sequence[AnswerKeys], clock: datetime) -> list[StoredOfAnswer]:
    """What is stored about each answer, in their order; answers to one place share its state."""
    keys = [{"number": str(number), **dict(zip(NAMES, (*answer.place, answer.credential, answer.key), strict=True))}
            for number, answer in enumerate(answers)]  # fmt: skip
    states, stored = dict[LearnerAt, QuestionState](), dict[int, StoredOfAnswer]()
    for row in read_by_keys(session, _query(session.get_bind().dialect.name), keys, clock=clock):
        number = int(row[0])
        place = answers[number].place
        if place not in states:
            states[place] = _make_state(row)
        earlier = EarlierRequest(*row[EARLIER]) if row.request_digest is not None else None
        stored[number] = StoredOfAnswer(bool(row.is_live), states[place], earlier)
    return [stored[number] for number in range(len(answers))]


def forget_key(session: Session, submission_id: str) -> None:
    """Lets the idempotency keys of a submission make another one."""
    session.execute(delete(IdempotencyKey).where(IdempotencyKey.submission_id == submission_id))


RESULT = Result.__table__.columns
RESULT_NAMES = tuple(RESULT.keys())
RESULT_AT = slice(8, 8 + len(RESULT))
SOURCE = slice(RESULT_AT.stop, RESULT_AT.stop + len(SourceAttempt._fields))
GRANTED = slice(SOURCE.stop, SOURCE.stop + 3)
EARLIER = slice(GRANTED.stop, GRANTED.stop + len(EarlierRequest._fields))
"""Where the parts of a row of the query stand."""


def _make_state(row: Any) -> QuestionState:
    attempts, pending, correct, newest = row[4:8]
    result, source, granted = row[RESULT_AT], row[SOURCE], row[GRANTED]
    return QuestionState(
        Progress() if attempts is None else Progress(attempts, pending, bool(correct)),
        newest or "",
        None if result[0] is None else dict(zip(RESULT_NAMES, result, strict=True)),
        None if source[0] is None else SourceAttempt(*source),
        None if granted[2] is None else Extension(due=granted[0], until=granted[1], attempts=granted[2]),
        row[2],
        row.policy_changes,
        bool(row[3]),
    )


@cache
def _query(backend: str) -> Select[*tuple[Any, ...]]:
    """The query on a table of keys, one row for each answer."""
    wanted = keys_table(backend, ("number", *NAMES))

    def at(table: Any, *names: str) -> Any:
        return and_(*(getattr(table, name) == wanted.c[name] for name in names))

    tried = (
        select(
            wanted.c.number,
            func.count().label("made"),
            func.count(case((Submission.outcome.is_(None), 1))).label("pending"),
            func.count(case((Submission.outcome == Status.CORRECT.value, 1))).label("correct"),
            func.max(Submission.id).label("newest"),
        )
        .select_from(wanted.join(Submission, at(Submission, *LearnerAt._fields)))
        .where(Submission.uses_attempt)
        .group_by(wanted.c.number)
        .subquery("tried")
    )
    live = is_alive(bindparam("clock", type_=UtcDateTime))
    credential = select(Credential.id).where(Credential.id == wanted.c.credential, live).scalar_subquery()
    delivers = exists().where(Destination.course == wanted.c.course, Destination.disabled_at.is_(None))
    return (
        select(
            wanted.c.number, credential.is_not(None).label("is_live"), Publication.published_at, delivers,
            tried.c.made, tried.c.pending, tried.c.correct, tried.c.newest,
            *RESULT,
            Submission.id, Submission.attempt, Submission.created_at, Submission.outcome, VerdictRow.points,
            ExtensionRow.due, ExtensionRow.until, ExtensionRow.attempts,
            IdempotencyKey.request_digest, IdempotencyKey.submission_id, IdempotencyKey.http_status,
            PolicyChange.changes.label("policy_changes"),
        )
        .select_from(wanted)
        .outerjoin(tried, tried.c.number == wanted.c.number)
        .outerjoin(Result, at(Result, *LearnerAt._fields))
        .outerjoin(Submission, and_(Submission.id == Result.submission_id, Submission.uses_attempt))
        .outerjoin(VerdictRow, NEWEST)
        .outerjoin(ExtensionRow, at(ExtensionRow, "course", "learner", "quiz"))
        .outerjoin(Publication, at(Publication, "course", "quiz"))
        .outerjoin(PolicyChange, at(PolicyChange, "course", "quiz"))
        .outerjoin(IdempotencyKey, at(IdempotencyKey, "course", "learner", "key"))
    )  # fmt: skip
