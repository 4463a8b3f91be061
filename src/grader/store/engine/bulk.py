"""Reads and writes many rows with one call, without an object of the session for each; and stores their timestamps."""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import UTC, datetime
from functools import cache
from typing import Any

from sqlalchemy import JSON, Dialect, Executable, FromClause, Text, bindparam, cast, column, func, select
from sqlalchemy.dialects import postgresql, sqlite
from sqlalchemy.dialects.postgresql import JSONB
from sqlalchemy.orm import DeclarativeBase, Session
from sqlalchemy.types import DateTime, TypeDecorator

DOCUMENT = JSON().with_variant(JSONB(), "postgresql")

PART_MAX = 64
"""Rows of one statement of SQLite."""

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


def values_of(row: DeclarativeBase) -> dict[str, Any]:
    """The columns that are set on a row."""
    return {name: value for name, value in vars(row).items() if not name.startswith("_")}


def insert_rows(
    session: Session, *tables: tuple[type[DeclarativeBase], Rows], replace: type[DeclarativeBase] | None = None
) -> None:
    """Inserts rows into tables, in this order; those of a table have the same columns, the others get defaults. Rows of
    the table `replace` have all columns, and each replaces the one with its primary key.

    The rows of a table go in one statement: a statement for each takes longer than the database takes to insert them,
    and a thread that calls a database waits after every call until the event loop lets it go on."""
    connection = session.connection()
    for table, rows in tables:
        if not rows:
            continue
        whole, replaces = _with_defaults(table, rows), table is replace
        names = tuple(one.name for one in table.__table__.columns if one.name in whole[0])
        if connection.dialect.name == "sqlite":
            for part in _split(whole):
                values = tuple(_sqlite_value(row[name]) for row in part for name in names)
                connection.exec_driver_sql(_insert_values(table, names, len(part), replaces=replaces), values)
        else:
            sent = json.dumps(whole, default=datetime.isoformat)
            connection.execute(_insert_json(table, names, replaces=replaces), {"rows": sent})


def _with_defaults(table: type[DeclarativeBase], rows: Rows) -> Rows:
    """The rows with the defaults of the columns that they lack."""
    missing = [one for one in table.__table__.columns if one.default is not None and one.name not in rows[0]]
    if not missing:
        return rows
    defaults = {one.name: one.default.arg(None) if one.default.is_callable else one.default.arg for one in missing}
    return [defaults | dict(row) for row in rows]


def _split(rows: Rows) -> Iterator[Rows]:
    """Yields the rows in parts whose numbers are powers of two, at most PART_MAX: SQLite prepares few statements."""
    begin = 0
    while begin < len(rows):
        size = min(PART_MAX, 1 << (len(rows) - begin).bit_length() - 1)
        yield rows[begin : begin + size]
        begin += size


def _sqlite_value(value: Any) -> Any:
    """A value as SQLAlchemy stores it in SQLite, which has no moments."""
    if isinstance(value, datetime):
        return value.astimezone(UTC).replace(tzinfo=None).isoformat(" ", "microseconds")
    return value


def insert_of(backend: str) -> Any:
    """The `insert` of a database that knows ON CONFLICT; SQLAlchemy has one for each."""
    return (sqlite if backend == "sqlite" else postgresql).insert


@cache
def _insert_json(table: type[DeclarativeBase], names: tuple[str, ...], *, replaces: bool) -> Any:
    """The statement for PostgreSQL that inserts rows with these columns, the parameter `rows`: a JSON list of objects.
    The driver takes longer to send parameters of their own than the server takes to insert them."""
    columns = table.__table__.columns
    read = func.json_to_recordset(cast(bindparam("rows", type_=Text), JSON))
    items = read.table_valued(*(column(name, columns[name].type) for name in names), name="items")
    row = insert_of("postgresql")(table.__table__)
    row = row.from_select(names, select(items.render_derived(with_types=True)))
    return _replacing(row, table) if replaces else row


@cache
def _insert_values(table: type[DeclarativeBase], names: tuple[str, ...], count: int, *, replaces: bool) -> str:
    """The statement for SQLite that inserts so many rows with these columns."""
    row: Any = insert_of("sqlite")(table.__table__).values(dict.fromkeys(names))
    text = str((_replacing(row, table) if replaces else row).compile(dialect=sqlite.dialect()))
    head, _, rest = text.partition(" VALUES ")
    values, _, tail = rest.partition(")")
    return f"{head} VALUES {', '.join([f'{values})'] * count)}{tail}"


def _replacing(row: Any, table: type[DeclarativeBase]) -> Any:
    columns = table.__table__.columns
    replaced = {one.name: row.excluded[one.name] for one in columns if not one.primary_key}
    return row.on_conflict_do_update(index_elements=[one for one in columns if one.primary_key], set_=replaced)
