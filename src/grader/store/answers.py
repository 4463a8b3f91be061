"""What is asked about many new answers at once, and what they leave in the results: one statement for each table."""

import json
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any, NamedTuple

from sqlalchemy import (
    ColumnElement,
    Select,
    String,
    and_,
    bindparam,
    case,
    func,
    literal,
    select,
    update,
)
from sqlalchemy.ext.compiler import compiles
from sqlalchemy.orm import Session
from sqlalchemy.sql.functions import FunctionElement

from grader.domain.policy import Extension, Progress
from grader.domain.verdict import Status
from grader.store import extensions
from grader.store.results import NEWEST, LearnerAt
from grader.store.tables import (
    Credential,
    ExtensionRow,
    IdempotencyKey,
    Result,
    ResultRevision,
    Submission,
    VerdictRow,
    insert_rows,
    plain,
    values_of,
)


class Given(FunctionElement[Any]):
    """The items of a JSON list of lists of texts, as rows: one parameter, however many they are."""

    name = "given"
    inherit_cache = True


class Part(FunctionElement[str]):
    """The text at a place of such an item."""

    type = String()
    inherit_cache = True


@compiles(Given, "sqlite")
def _given_in_sqlite(element: Given, compiler: Any, **kw: Any) -> str:
    return f"json_each({compiler.process(element.clauses, **kw)})"


@compiles(Given, "postgresql")
def _given_in_postgresql(element: Given, compiler: Any, **kw: Any) -> str:
    return f"json_array_elements(CAST({compiler.process(element.clauses, **kw)} AS json))"


@compiles(Part, "sqlite")
def _part_in_sqlite(element: Part, compiler: Any, **kw: Any) -> str:
    item, place = element.clauses
    return f"json_extract({compiler.process(item, **kw)}, '$[{place.value}]')"


@compiles(Part, "postgresql")
def _part_in_postgresql(element: Part, compiler: Any, **kw: Any) -> str:
    item, place = element.clauses
    return f"({compiler.process(item, **kw)} ->> {place.value})"


GIVEN = Given(bindparam("given", type_=String)).table_valued("value", name="given")


def _equal(*columns: Any) -> ColumnElement[bool]:
    """Whether columns are those of a given item, in order."""
    return and_(*(column == Part(GIVEN.c.value, literal(place)) for place, column in enumerate(columns)))


def _key(table: Any) -> list[Any]:
    return [getattr(table, name) for name in LearnerAt._fields]


def _among(rows: Any, joined: type[Any], on: ColumnElement[bool]) -> Any:
    return rows.select_from(GIVEN).join(joined, on)


ALIVE = _among(select(Credential.id, Credential.expires_at), Credential, _equal(Credential.id)).where(
    Credential.revoked_at.is_(None)
)
KEYS = _among(
    select(*IdempotencyKey.__table__.columns),
    IdempotencyKey,
    _equal(IdempotencyKey.course, IdempotencyKey.learner, IdempotencyKey.key),
)
PROGRESS = _among(
    select(
        *_key(Submission),
        func.count(),
        func.sum(case((Submission.outcome.is_(None), 1), else_=0)),
        func.max(case((Submission.outcome == Status.CORRECT.value, 1), else_=0)),
    ),
    Submission,
    _equal(*_key(Submission)) & Submission.uses_attempt,
).group_by(*_key(Submission))
RESULTS = (
    _among(
        select(
            *Result.__table__.columns,
            Submission.id.label("source_id"),
            Submission.attempt.label("source_attempt"),
            Submission.created_at.label("source_at"),
            Submission.outcome.label("source_outcome"),
            VerdictRow.points.label("source_points"),
        ),
        Result,
        _equal(*_key(Result)),
    )
    .outerjoin(Submission, (Submission.id == Result.submission_id) & Submission.uses_attempt)
    .outerjoin(VerdictRow, NEWEST)
)
EXTENSIONS = _among(
    select(*ExtensionRow.__table__.columns),
    ExtensionRow,
    _equal(ExtensionRow.course, ExtensionRow.learner, ExtensionRow.quiz),
)
RESULT_COLUMNS = tuple(Result.__table__.columns.keys())
CHANGE = (
    update(Result)
    .where(*(getattr(Result, name) == bindparam(f"of_{name}") for name in LearnerAt._fields))
    .values({name: bindparam(name) for name in RESULT_COLUMNS if name not in LearnerAt._fields})
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
    result: Result | None = None
    source: Source | None = None


def alive(session: Session, credentials: Collection[str], clock: datetime) -> set[str]:
    """Those of the credentials that are neither revoked nor expired."""
    rows = _ask(session, ALIVE, [(one,) for one in credentials])
    return {row.id for row in rows if row.expires_at is None or row.expires_at > clock}


def keys(session: Session, wanted: Collection[tuple[str, str, str]]) -> dict[tuple[str, str, str], Any]:
    """The rows of earlier requests by course, learner and idempotency key."""
    return {(row.course, row.learner, row.key): row for row in _ask(session, KEYS, wanted)}


def found(session: Session, places: Collection[LearnerAt]) -> dict[LearnerAt, Found]:
    """What is stored of every learner at every question that is asked for."""
    at = {place: Found() for place in places}
    for row in _ask(session, PROGRESS, places):
        at[LearnerAt(*row[:4])].progress = Progress(row[4], row[5], bool(row[6]))
    for row in _ask(session, RESULTS, places):
        here = at[LearnerAt(*row[:4])]
        here.result = plain(Result, dict(zip(RESULT_COLUMNS, row, strict=False)))
        here.source = None if row.source_id is None else Source(*row[-len(Source._fields) :])
    return at


def granted(session: Session, wanted: Collection[tuple[str, str, str]]) -> dict[tuple[str, str, str], Extension]:
    """Extensions by course, learner and quiz."""
    return {(row.course, row.learner, row.quiz): extensions.extension(row) for row in _ask(session, EXTENSIONS, wanted)}


def put_results(session: Session, new: Sequence[Result], old: Sequence[Result], told: Sequence[dict[str, Any]]) -> None:
    """Inserts new results, writes changed ones, and appends the rows of the feed."""
    insert_rows(session, Result, [values_of(result) for result in new])
    if old:
        rows = [values_of(result) for result in old]
        keyed = [{f"of_{name}": row.pop(name) for name in LearnerAt._fields} | row for row in rows]
        session.connection().execute(CHANGE, keyed)
    insert_rows(session, ResultRevision, told)


def _ask(session: Session, query: Select[Any], wanted: Collection[Sequence[str]]) -> Sequence[Any]:
    if not wanted:
        return ()
    return session.connection().execute(query, {"given": json.dumps(list(wanted))}).all()
