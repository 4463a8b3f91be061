"""Inserts many rows of a table with one call, without an object of the session for each."""

from collections.abc import Sequence
from functools import cache
from typing import Any

from sqlalchemy import insert
from sqlalchemy.dialects import postgresql, sqlite
from sqlalchemy.orm import DeclarativeBase, Session


def insert_rows(session: Session, table: type[DeclarativeBase], rows: Sequence[dict[str, Any]]) -> None:
    """Inserts rows, which have the same columns; columns that are left out get their defaults."""
    if rows:
        session.connection().execute(insert(table), rows)


def upsert_rows(session: Session, table: type[DeclarativeBase], rows: Sequence[dict[str, Any]]) -> None:
    """Inserts rows with all columns of a table; each replaces the row with its primary key."""
    if rows:
        session.connection().execute(_upsert(table, session.get_bind().dialect.name), rows)


def insert_of(backend: str) -> Any:
    """The `insert` of a database that knows ON CONFLICT; SQLAlchemy has one for each."""
    return (sqlite if backend == "sqlite" else postgresql).insert


@cache
def _upsert(table: type[DeclarativeBase], backend: str) -> Any:
    row, columns = insert_of(backend)(table), table.__table__.columns
    replaced = {one.name: row.excluded[one.name] for one in columns if not one.primary_key}
    return row.on_conflict_do_update(index_elements=[one for one in columns if one.primary_key], set_=replaced)
