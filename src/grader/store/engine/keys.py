"""Reads the rows of many keys with one query, where a key has several columns."""

from collections.abc import Iterable, Sequence
from functools import cache
from typing import Any

from sqlalchemy import JSON, Select, and_, bindparam, column, func, select
from sqlalchemy.dialects.postgresql import JSONB
from sqlalchemy.orm import InstrumentedAttribute, Session

DOCUMENT = JSON().with_variant(JSONB(), "postgresql")

Columns = tuple[InstrumentedAttribute[str], ...]


def read_by_keys(
    session: Session, query: Select[*tuple[Any, ...]], columns: Columns, keys: Iterable[Sequence[str]]
) -> Sequence[Any]:
    """The query's rows whose `columns` are one of the keys; a key that is given twice gives its rows twice.

    Reads what is in the database: objects of the session are not flushed before.
    """
    names = [one.key for one in columns]
    document = [dict(zip(names, key, strict=True)) for key in keys]
    if not document:
        return ()
    statement = _filter_by_keys(query, columns, session.get_bind().dialect.name)
    return session.connection().execute(statement, {"keys": document}).all()


@cache
def _filter_by_keys(query: Select[*tuple[Any, ...]], columns: Columns, backend: str) -> Select[*tuple[Any, ...]]:
    """The query, joined with its keys as a table.

    They are one parameter, a JSON list of objects: the text of the query, and with it the prepared plan, is the same
    for any number of keys. SQLite finds no index for `(a, b) IN (...)`.
    """
    read = func.json_each if backend == "sqlite" else func.jsonb_array_elements
    items = read(bindparam("keys", type_=DOCUMENT)).table_valued(column("value", DOCUMENT), name="items")
    wanted = select(*(items.c.value[one.key].as_string().label(one.key) for one in columns)).subquery("wanted")
    return query.join(wanted, and_(*(one == wanted.c[one.key] for one in columns)))
