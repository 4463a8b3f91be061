"""Reads and writes many rows with one call, without an object of the session for each; and stores their timestamps."""

import json
from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from functools import cache
from typing import Any

from sqlalchemy import JSON, Dialect, Executable, FromClause, Text, bindparam, cast, column, func, select
from sqlalchemy.dialects import postgresql, sqlite
from sqlalchemy.dialects.postgresql import JSONB
from sqlalchemy.orm import DeclarativeBase, Session
from sqlalchemy.types import DateTime, TypeDecorator

DOCUMENT = JSON().with_variant(JSONB(), "postgresql")

Rows = Sequence[Mapping[str, Any]]


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


def insert_rows(
    session: Session, *tables: tuple[type[DeclarativeBase], Rows], replace: type[DeclarativeBase] | None = None
) -> None:
    """Inserts rows into tables, in this order, with one statement each; those of a table have the same columns, the
    others get defaults. Rows of the table `replace` have all columns, and each replaces the one with its primary key.

    PostgreSQL gets all rows of a table as one parameter, a JSON list of objects: the driver takes longer to send a row
    of its own than the server takes to insert it. Their values are those of JSON, and moments."""
    backend = session.get_bind().dialect.name
    for table, rows in tables:
        if not rows:
            continue
        statement = _insert(table, tuple(rows[0]), backend, replaces=table is replace)
        sent = rows if backend == "sqlite" else {"rows": json.dumps(rows, default=datetime.isoformat)}
        session.connection().execute(statement, sent)


def insert_of(backend: str) -> Any:
    """The `insert` of a database that knows ON CONFLICT; SQLAlchemy has one for each."""
    return (sqlite if backend == "sqlite" else postgresql).insert


@cache
def _insert(table: type[DeclarativeBase], names: tuple[str, ...], backend: str, *, replaces: bool) -> Any:
    """The statement that inserts rows with these columns."""
    columns = table.__table__.columns
    row = insert_of(backend)(table.__table__)
    if backend != "sqlite":
        read = func.json_to_recordset(cast(bindparam("rows", type_=Text), JSON))
        items = read.table_valued(*(column(name, columns[name].type) for name in names), name="items")
        row = row.from_select(names, select(items.render_derived(with_types=True)))
    if not replaces:
        return row
    replaced = {one.name: row.excluded[one.name] for one in columns if not one.primary_key}
    return row.on_conflict_do_update(index_elements=[one for one in columns if one.primary_key], set_=replaced)
