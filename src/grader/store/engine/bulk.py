"""Reads and writes many rows with one call, without an object of the session for each; and stores their timestamps."""

import sqlite3
from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from functools import cache, lru_cache
from operator import itemgetter
from typing import Any

from pydantic_core import to_json
from sqlalchemy import JSON, Dialect, Executable, FromClause, Text, bindparam, cast, column, func, select
from sqlalchemy.dialects import postgresql, sqlite
from sqlalchemy.dialects.postgresql import JSONB
from sqlalchemy.orm import DeclarativeBase, Session
from sqlalchemy.types import DateTime, TypeDecorator

DOCUMENT = JSON().with_variant(JSONB(), "postgresql")

Rows = Sequence[Mapping[str, Any]]
TableRows = tuple[type[DeclarativeBase], Rows]


class UtcDateTime(TypeDecorator[datetime]):
    """An aware datetime in UTC; SQLite itself forgets the zone."""

    impl = DateTime(timezone=True)
    cache_ok = True

    def process_bind_param(self, value: datetime | None, _dialect: Dialect) -> datetime | None:
        """To UTC."""
        return None if value is None else value.astimezone(UTC)

    def process_result_value(self, value: datetime | None, _dialect: Dialect) -> datetime | None:
        """To an aware datetime in UTC."""
        if value is None:
            return None
        return value.replace(tzinfo=UTC) if value.tzinfo is None else value.astimezone(UTC)


def keys_table(backend: str, names: Iterable[str]) -> FromClause:
    """A table of keys, with a column of text for each name, whose rows are the parameter `keys` of `read_by_keys`. They
    are one parameter, a JSON list of objects: the text of a query, and with it the prepared plan, is the same for any
    number of keys. SQLite finds no index for `(a, b) IN (...)`."""
    read = func.json_each if backend == "sqlite" else func.jsonb_array_elements
    items = read(bindparam("keys", type_=DOCUMENT)).table_valued(column("value", DOCUMENT), name="items")
    return select(*(items.c.value[name].as_string().label(name) for name in names)).cte("wanted")


def read_by_keys(session: Session, query: Executable, keys: Rows, **parameters: Any) -> Sequence[Any]:
    """The rows of a query on a `keys_table` with these keys, as they are in the database: nothing is flushed before."""
    return session.connection().execute(query, {"keys": keys, **parameters}).all() if keys else ()


def insert_rows(session: Session, *tables: TableRows, replace: type[DeclarativeBase] | None = None) -> None:
    """Inserts rows into tables, in this order; those of a table have the same columns, the others get defaults. Rows of
    the table `replace` have all columns, and each replaces the one with its primary key.

    PostgreSQL gets one statement for all tables: each would be one more round trip, and takes longer in the driver than
    the server takes to insert its rows. SQLite gets one for each table, which it prepares once for all rows."""
    connection = session.connection()
    filled = [(table, _with_defaults(table, rows)) for table, rows in tables if rows]
    columns = [(table, tuple(column.name for column in table.__table__.columns if column.name in rows[0]))
               for table, rows in filled]  # fmt: skip
    if connection.dialect.name == "sqlite":
        for (table, names), (_, rows) in zip(columns, filled, strict=True):
            statement = _insert_values(table, names, replaces=table is replace)
            connection.exec_driver_sql(statement, list(map(itemgetter(*names), rows)))
    elif filled:
        sent = {bind_rows(table): to_json(rows).decode() for table, rows in filled}
        connection.execute(_insert_json(tuple(columns), replace), sent)


def _with_defaults(table: type[DeclarativeBase], rows: Rows) -> Rows:
    """The rows with the defaults of the columns that they lack."""
    missing = [
        column for column in table.__table__.columns if column.default is not None and column.name not in rows[0]
    ]
    if not missing:
        return rows
    defaults = {
        column.name: column.default.arg(None) if column.default.is_callable else column.default.arg
        for column in missing
    }
    return [defaults | dict(row) for row in rows]


@lru_cache(maxsize=16)
def _sqlite_moment(moment: datetime) -> str:
    """A moment as SQLAlchemy stores it in SQLite, which has none. All rows of a transaction have the same."""
    return moment.astimezone(UTC).replace(tzinfo=None).isoformat(" ", "microseconds")


sqlite3.register_adapter(datetime, _sqlite_moment)


def get_insert(backend: str) -> Any:
    """The `insert` of a database that knows ON CONFLICT; SQLAlchemy has one for each."""
    return (sqlite if backend == "sqlite" else postgresql).insert


def bind_rows(table: type[DeclarativeBase]) -> str:
    """The parameter with the rows of a table: a JSON list of objects."""
    return f"rows_of_{table.__tablename__}"


@cache
def _insert_json(
    columns: tuple[tuple[type[DeclarativeBase], tuple[str, ...]], ...], replace: type[DeclarativeBase] | None
) -> Any:
    """The statement for PostgreSQL that inserts rows with these columns into each table, all at once: foreign keys are
    checked at its end. The driver takes longer to send parameters of their own than the server takes to insert them."""
    *others, last = [_insert_from_json(table, names, replaces=table is replace) for table, names in columns]
    return last.add_cte(*(statement.cte(f"into_{number}") for number, statement in enumerate(others)))


def _insert_from_json(table: type[DeclarativeBase], names: tuple[str, ...], *, replaces: bool) -> Any:
    columns = table.__table__.columns
    read = func.json_to_recordset(cast(bindparam(bind_rows(table), type_=Text), JSON))
    items = read.table_valued(*(column(name, columns[name].type) for name in names), name="items")
    row = get_insert("postgresql")(table.__table__)
    row = row.from_select(names, select(items.render_derived(with_types=True)))
    return _replacing(row, table) if replaces else row


@cache
def _insert_values(table: type[DeclarativeBase], names: tuple[str, ...], *, replaces: bool) -> str:
    """The statement for SQLite that inserts a row with these columns."""
    row: Any = get_insert("sqlite")(table.__table__).values(dict.fromkeys(names))
    return str((_replacing(row, table) if replaces else row).compile(dialect=sqlite.dialect()))


def _replacing(row: Any, table: type[DeclarativeBase]) -> Any:
    columns = table.__table__.columns
    replaced = {column.name: row.excluded[column.name] for column in columns if not column.primary_key}
    return row.on_conflict_do_update(index_elements=[column for column in columns if column.primary_key], set_=replaced)
