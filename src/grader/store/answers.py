"""What is asked about many new answers at once, in one query, and what they leave in the results."""

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any, NamedTuple

from sqlalchemy import ColumnElement, String, and_, case, exists, func, literal, select
from sqlalchemy.ext.compiler import compiles
from sqlalchemy.orm import Session, aliased
from sqlalchemy.sql.functions import FunctionElement

from grader.domain.policy import Extension, Progress
from grader.domain.verdict import Status
from grader.store import extensions
from grader.store.given import GIVEN, Part
from grader.store.outbox import Destination
from grader.store.results import LearnerAt
from grader.store.rows import insert_rows
from grader.store.tables import (
    Credential,
    ExtensionRow,
    IdempotencyKey,
    Result,
    ResultRevision,
    Submission,
    VerdictRow,
    plain,
    values_of,
)


class Listed(FunctionElement[str]):
    """Values as the text of a JSON list: several aggregates of one subquery."""

    type = String()
    inherit_cache = True


@compiles(Listed, "sqlite")
def _listed_in_sqlite(element: Listed, compiler: Any, **kw: Any) -> str:
    return f"json_array({compiler.process(element.clauses, **kw)})"


@compiles(Listed, "postgresql")
def _listed_in_postgresql(element: Listed, compiler: Any, **kw: Any) -> str:
    return f"CAST(json_build_array({compiler.process(element.clauses, **kw)}) AS text)"


class Asked(NamedTuple):
    """A new answer: the learner at the question, the credential, and the idempotency key, which is empty for none."""

    course: str
    learner: str
    quiz: str
    question: str
    credential: str
    key: str

    @property
    def at(self) -> LearnerAt:
        """The learner at the question."""
        return LearnerAt(*self[:4])


def _given(name: str) -> Part:
    return Part(GIVEN.c.value, literal(Asked._fields.index(name)))


def _same(table: Any, *names: str) -> ColumnElement[bool]:
    """Whether these columns of a table are those of the given answer."""
    return and_(*(getattr(table, name) == _given(name) for name in names))


ATTEMPTS = (
    select(
        Listed(
            func.count(),
            func.count(case((Submission.outcome.is_(None), 1))),
            func.count(case((Submission.outcome == Status.CORRECT.value, 1))),
            func.max(Submission.id),
        )
    )
    .where(_same(Submission, *LearnerAt._fields), Submission.uses_attempt)
    .scalar_subquery()
)
DESTINATIONS = exists().where(_same(Destination, "course"), Destination.disabled_at.is_(None))
SOURCE = aliased(Submission)
NEWEST = (VerdictRow.submission_id == SOURCE.id) & (VerdictRow.revision == SOURCE.revision)
RESULT_COLUMNS = tuple(Result.__table__.columns.keys())
QUERY = (
    select(
        *Result.__table__.columns,
        *(_given(name).label(f"given_{name}") for name in Asked._fields),
        ATTEMPTS.label("attempts_made"),
        DESTINATIONS.label("has_destinations"),
        Credential.id.label("alive"),
        Credential.expires_at,
        SOURCE.id.label("source_id"),
        SOURCE.attempt.label("source_attempt"),
        SOURCE.created_at.label("source_at"),
        SOURCE.outcome.label("source_outcome"),
        VerdictRow.points.label("source_points"),
        IdempotencyKey.submission_id.label("earlier_id"),
        IdempotencyKey.request_digest,
        IdempotencyKey.http_status,
        ExtensionRow.quiz.label("extended"),
        ExtensionRow.due,
        ExtensionRow.until,
        ExtensionRow.attempts,
    )
    .select_from(GIVEN)
    .outerjoin(Credential, (Credential.id == _given("credential")) & Credential.revoked_at.is_(None))
    .outerjoin(Result, _same(Result, *LearnerAt._fields))
    .outerjoin(SOURCE, (SOURCE.id == Result.submission_id) & SOURCE.uses_attempt)
    .outerjoin(VerdictRow, NEWEST)
    .outerjoin(IdempotencyKey, _same(IdempotencyKey, "course", "learner", "key"))
    .outerjoin(ExtensionRow, _same(ExtensionRow, "course", "learner", "quiz"))
)


class Source(NamedTuple):
    """The attempt that a result comes from, with the points of its newest verdict."""

    id: str
    attempt: int
    created_at: datetime
    outcome: str | None
    points: float | None


@dataclass
class Found:
    """What is stored of a learner at a question."""

    progress: Progress = field(default_factory=Progress)
    newest: str = ""
    """The id of the newest attempt; empty without one."""
    result: Result | None = None
    source: Source | None = None
    extension: Extension | None = None
    has_destinations: bool = True
    """Whether changes of results of the course are sent anywhere."""


class Earlier(NamedTuple):
    """The submission that an earlier request with the same idempotency key made."""

    submission_id: str
    request_digest: str
    http_status: int


@dataclass
class Stored:
    """What the database holds about new answers."""

    alive: set[str] = field(default_factory=set)
    """The credentials that are neither revoked nor expired."""
    at: dict[LearnerAt, Found] = field(default_factory=dict)
    earlier: dict[tuple[str, str, str], Earlier] = field(default_factory=dict)
    """By course, learner and idempotency key."""


def stored(session: Session, asked: Iterable[Asked], clock: datetime) -> Stored:
    """What the database holds about new answers; in one query, however many they are."""
    known = Stored()
    for row in session.connection().execute(QUERY, {"given": json.dumps(list(dict.fromkeys(asked)))}):
        one = Asked(*row[len(RESULT_COLUMNS) :][: len(Asked._fields)])
        if row.alive is not None and (row.expires_at is None or row.expires_at > clock):
            known.alive.add(one.credential)
        if row.earlier_id is not None:
            known.earlier[one.course, one.learner, one.key] = Earlier(
                row.earlier_id, row.request_digest, row.http_status
            )
        if one.at not in known.at:
            known.at[one.at] = _found(row)
    return known


def _found(row: Any) -> Found:
    made, pending, correct, newest = json.loads(row.attempts_made)
    found = Found(Progress(made, pending, bool(correct)), newest or "", has_destinations=row.has_destinations)
    if row.submission_id is not None:
        found.result = plain(Result, dict(zip(RESULT_COLUMNS, row, strict=False)))
    if row.source_id is not None:
        found.source = Source(row.source_id, row.source_attempt, row.source_at, row.source_outcome, row.source_points)
    if row.extended is not None:
        found.extension = extensions.extension(row)
    return found


def put_results(session: Session, changed: Sequence[Result], told: Sequence[dict[str, Any]]) -> None:
    """Writes new and changed results, and appends the rows of the feed."""
    insert_rows(session, Result, [values_of(result) for result in changed], replace=True)
    insert_rows(session, ResultRevision, told)
