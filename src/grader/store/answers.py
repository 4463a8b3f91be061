"""What is asked about many new answers at once, in one query, and what they leave in the results."""

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from functools import cache
from typing import Any, NamedTuple

from sqlalchemy import ColumnElement, String, and_, case, exists, func, literal, select
from sqlalchemy.ext.compiler import compiles
from sqlalchemy.orm import Session, aliased
from sqlalchemy.sql.functions import FunctionElement

from grader.domain.policy import Extension, Progress
from grader.domain.verdict import Status
from grader.store import extensions
from grader.store.direct import DirectQuery
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
    """A new answer: the learner at the question, and the credential."""

    course: str
    learner: str
    quiz: str
    question: str
    credential: str
    key: str
    """Of idempotency; empty for none."""
    is_extensible: bool
    """Whether an extension could change anything at the question."""

    @property
    def at(self) -> LearnerAt:
        """The learner at the question."""
        return LearnerAt(*self[:4])


PLACE = Asked._fields.index("is_extensible")
"""The texts before it go to the database, and then the place of the answer."""


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
RESULT_COLUMNS = tuple(column.name for column in Result.__table__.columns if not column.primary_key)


@cache
def _query(*, with_keys: bool, with_extensions: bool) -> DirectQuery:
    """What is stored about given answers; each join costs the database as much as the rest of an answer's row."""
    query = (
        select(
            *(getattr(Result, name) for name in RESULT_COLUMNS),
            Part(GIVEN.c.value, literal(PLACE)).label("place"),
            ATTEMPTS.label("attempts_made"),
            DESTINATIONS.label("has_destinations"),
            Credential.id.label("alive"),
            Credential.expires_at,
            SOURCE.id.label("source_id"),
            SOURCE.attempt.label("source_attempt"),
            SOURCE.created_at.label("source_at"),
            SOURCE.outcome.label("source_outcome"),
            VerdictRow.points.label("source_points"),
        )
        .select_from(GIVEN)
        .outerjoin(Credential, (Credential.id == _given("credential")) & Credential.revoked_at.is_(None))
        .outerjoin(Result, _same(Result, *LearnerAt._fields))
        .outerjoin(SOURCE, (SOURCE.id == Result.submission_id) & SOURCE.uses_attempt)
        .outerjoin(VerdictRow, NEWEST)
    )
    if with_keys:
        query = query.outerjoin(IdempotencyKey, _same(IdempotencyKey, "course", "learner", "key")).add_columns(
            IdempotencyKey.submission_id.label("earlier_id"), IdempotencyKey.request_digest, IdempotencyKey.http_status
        )
    if with_extensions:
        query = query.outerjoin(ExtensionRow, _same(ExtensionRow, "course", "learner", "quiz")).add_columns(
            ExtensionRow.quiz.label("extended"), ExtensionRow.due, ExtensionRow.until, ExtensionRow.attempts
        )
    return DirectQuery(query)


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
    known, every = Stored(), list(dict.fromkeys(asked))
    keyed, extended = any(one.key for one in every), any(one.is_extensible for one in every)
    given = json.dumps([(*one[:PLACE], place) for place, one in enumerate(every)])
    for row in _query(with_keys=keyed, with_extensions=extended).rows(session.connection(), given=given):
        one = every[int(row.place)]
        if row.alive is not None and (row.expires_at is None or row.expires_at > clock):
            known.alive.add(one.credential)
        if keyed and row.earlier_id is not None:
            known.earlier[one.course, one.learner, one.key] = Earlier(
                row.earlier_id, row.request_digest, row.http_status
            )
        if one.at not in known.at:
            known.at[one.at] = found = _found(one.at, row)
            if one.is_extensible and row.extended is not None:
                found.extension = extensions.extension(row)
    return known


def _found(at: LearnerAt, row: Any) -> Found:
    made, pending, correct, newest = json.loads(row.attempts_made)
    found = Found(Progress(made, pending, bool(correct)), newest or "", has_destinations=row.has_destinations)
    if row.submission_id is not None:
        found.result = plain(Result, {**at._asdict(), **dict(zip(RESULT_COLUMNS, row, strict=False))})
    if row.source_id is not None:
        found.source = Source(row.source_id, row.source_attempt, row.source_at, row.source_outcome, row.source_points)
    return found


def put_results(session: Session, changed: Sequence[Result], told: Sequence[dict[str, Any]]) -> None:
    """Writes new and changed results, and appends the rows of the feed."""
    insert_rows(session, Result, [values_of(result) for result in changed], replace=True)
    insert_rows(session, ResultRevision, told)
