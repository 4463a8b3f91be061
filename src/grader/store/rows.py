"""Rows inserted without the unit of work, many at once.

SQLite takes the rows of a table with `executemany`. PostgreSQL takes them as one JSON document, and those of several
tables in one statement: a round trip costs more than the rows do.
"""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from operator import itemgetter
from typing import Any

from pydantic_core import to_json
from sqlalchemy import Connection, Table
from sqlalchemy.dialects import sqlite
from sqlalchemy.orm import Session

from grader.store.driver import as_sqlalchemy, driver_of
from grader.store.later import keep_back
from grader.store.tables import Base

WAITING = "rows"


@dataclass(frozen=True)
class _Kind:
    """Which columns of a table are inserted; whether a row replaces the one with its key."""

    table: Table
    columns: tuple[str, ...]
    replaces: bool


def insert_rows(session: Session, table: type[Base], rows: Sequence[dict[str, Any]], *, replace: bool = False) -> None:
    """Inserts rows of one table, which have the same columns; `replace` overwrites all columns of rows with their keys.

    Columns that are left out get their defaults.
    """
    if not rows:
        return
    kind = _Kind(Base.metadata.tables[table.__tablename__], tuple(rows[0]), replace)
    if (waiting := session.info.get(WAITING)) is not None:
        waiting.setdefault(kind, []).extend(rows)
    else:
        _insert(session.connection(), {kind: rows})


@contextmanager
def inserted_together(session: Session) -> Iterator[None]:
    """Lets `insert_rows` wait for the end of the block, and inserts everything then: on PostgreSQL in one statement.

    Queries within the block do not see the rows, unless `insert_waiting` is called before.
    """
    session.info[WAITING] = {}
    try:
        yield
        insert_waiting(session)
    finally:
        del session.info[WAITING]


def insert_waiting(session: Session) -> None:
    """Inserts the rows that wait."""
    if waiting := session.info.get(WAITING):
        _insert(session.connection(), waiting)
        waiting.clear()


def _insert(connection: Connection, rows: dict[_Kind, Any]) -> None:
    """Inserts rows past SQLAlchemy, which would take longer with each than the database does."""
    if connection.dialect.name == "sqlite":
        with as_sqlalchemy(connection):
            for kind, several in rows.items():
                driver_of(connection).executemany(_statement_in_sqlite(kind), _in_sqlite(kind, several))
    else:
        values = {f"rows{place}": _as_json(kind, several) for place, (kind, several) in enumerate(rows.items())}
        keep_back(connection, _statement(tuple(rows)), values)


def _as_json(kind: _Kind, rows: Sequence[dict[str, Any]]) -> str:
    return to_json(
        _completed(kind, rows), inf_nan_mode="strings"
    ).decode()  # PostgreSQL reads the text "Infinity" as a number


def _completed(kind: _Kind, rows: Sequence[dict[str, Any]]) -> Sequence[dict[str, Any]]:
    """The rows with the defaults of columns that are left out."""
    made = _defaults(kind)
    return [row | {name: make(None) for name, make in made.items()} for row in rows] if made else rows


@cache
def _defaults(kind: _Kind) -> dict[str, Any]:
    """What makes the values of columns that are left out."""
    missing = [column for column in kind.table.columns if column.name not in kind.columns]
    return {column.name: _made_by(column.default) for column in missing if column.default is not None}


def _made_by(default: Any) -> Any:
    return default.arg if default.is_callable else lambda _context: default.arg


@cache
def _statement(kinds: tuple[_Kind, ...]) -> str:
    """Inserts rows of several tables at once. Foreign keys are checked at the end of a statement, so in any order."""
    inserts = [_insert_of(kind, f"%(rows{place})s") for place, kind in enumerate(kinds)]
    first = ", ".join(f"insert{place} AS ({insert})" for place, insert in enumerate(inserts[:-1]))
    return f"WITH {first} {inserts[-1]}" if first else inserts[-1]


def _insert_of(kind: _Kind, given: str) -> str:
    columns = _quoted(_names(kind))
    rows = f'json_populate_recordset(CAST(NULL AS "{kind.table.name}"), CAST({given} AS json))'
    insert = f'INSERT INTO "{kind.table.name}" ({columns}) SELECT {columns} FROM {rows}'  # noqa: S608  no values
    return insert + _conflict(kind)


def _in_sqlite(kind: _Kind, rows: Sequence[dict[str, Any]]) -> list[tuple[Any, ...]]:
    """The rows as the driver takes them."""
    take, converted = itemgetter(*_names(kind)), _converted(kind).items()
    return [take(row | {name: convert(row[name]) for name, convert in converted}) for row in _completed(kind, rows)]


@cache
def _statement_in_sqlite(kind: _Kind) -> str:
    names = _names(kind)
    places = ", ".join("?" * len(names))
    insert = f'INSERT INTO "{kind.table.name}" ({_quoted(names)}) VALUES ({places})'  # noqa: S608  no values
    return insert + _conflict(kind)


@cache
def _converted(kind: _Kind) -> dict[str, Any]:
    """What converts the values of some columns, such as times, to those that the driver stores."""
    dialect = sqlite.dialect()
    made = {name: kind.table.columns[name].type.dialect_impl(dialect).bind_processor(dialect) for name in _names(kind)}
    return {name: convert for name, convert in made.items() if convert is not None}


def _names(kind: _Kind) -> tuple[str, ...]:
    return (*kind.columns, *_defaults(kind))


def _quoted(names: Iterable[str]) -> str:
    return ", ".join(f'"{name}"' for name in names)


def _conflict(kind: _Kind) -> str:
    """What to do where a row has the key of another."""
    if not kind.replaces:
        return ""
    key = [column.name for column in kind.table.primary_key]
    replaced = ", ".join(f'"{name}" = excluded."{name}"' for name in _names(kind) if name not in key)
    return f" ON CONFLICT ({_quoted(key)}) DO UPDATE SET {replaced}"
