"""Databases for tests: SQLite in a temporary folder, and a schema of its own on PostgreSQL where one answers.

Each process of pytest-xdist has a PostgreSQL database of its own: NOTIFY and advisory locks know no schemas.
"""

import os
import secrets
from collections.abc import Iterator
from contextlib import closing, contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import psycopg
import pytest
from sqlalchemy import event
from sqlalchemy.engine import Engine, make_url

from grader.store.engine.database import Database

POSTGRES = os.environ.get("GRADER_TEST_POSTGRES", "postgresql://postgres@127.0.0.1:5432/test")
WORKER = os.environ.get("PYTEST_XDIST_WORKER")
BACKENDS = ("sqlite", "postgresql")
CONNECT_S = 30
"""How long a busy machine may take to answer [s]."""


@contextmanager
def database_url(backend: str, folder: Path, *, empty: bool = False, durable: bool = False) -> Iterator[str]:
    """The URL of a database without rows; skips where no PostgreSQL answers.

    A schema of PostgreSQL has the newest tables already, unless `empty`: to copy them costs less than every migration.
    Its commits do not wait for the disk, unless `durable`: only the server's own end could lose them.
    """
    if backend == "sqlite":
        yield f"sqlite:///{folder / 'grader.db'}"
        return
    need_postgresql()
    schema, server = f"grader_test_{secrets.token_hex(6)}", own_database()
    with psycopg.connect(server, autocommit=True, connect_timeout=CONNECT_S) as connection:
        connection.execute(f"CREATE SCHEMA {schema}")
        if not empty:
            connection.execute(f"SET search_path TO {schema};{newest_schema()}".encode())
        try:
            options = f"{'' if durable else '-csynchronous_commit=off '}-csearch_path={schema}"
            url = make_url(server).update_query_dict({"options": options})
            yield url.render_as_string(hide_password=False).replace("+", "%20")  # libpq takes + as it is
        finally:
            connection.execute(f"DROP SCHEMA {schema} CASCADE")


@contextmanager
def open_database(backend: str, folder: Path) -> Iterator[Database]:
    """A database with the newest tables and no rows."""
    with database_url(backend, folder) as url, closing(Database(url)) as database:
        database.migrate()
        yield database


@cache
def newest_schema() -> str:
    """The SQL that makes the newest tables in an empty schema of PostgreSQL: what the migrations of one execute."""
    executed: list[str] = []
    with (
        database_url("postgresql", Path(), empty=True) as url,
        closing(Database(url)) as database,
        psycopg.connect(own_database(), connect_timeout=CONNECT_S) as connection,
    ):

        def note(_connection: object, _cursor: object, statement: str, parameters: Any, *_: object) -> None:
            if not statement.startswith("SELECT"):
                executed.append(psycopg.ClientCursor(connection).mogrify(statement, parameters))

        event.listen(Engine, "before_cursor_execute", note)
        try:
            database.migrate()
        finally:
            event.remove(Engine, "before_cursor_execute", note)
    return ";\n".join(executed)


def need_postgresql() -> None:
    """Skips where no PostgreSQL answers."""
    if not postgresql_answers():
        pytest.skip(f"no PostgreSQL answers at {POSTGRES}; set GRADER_TEST_POSTGRES to test on one")


@cache
def postgresql_answers() -> bool:
    """Asked once: where it has answered, a test that cannot connect later fails instead of being skipped."""
    try:
        psycopg.connect(POSTGRES, connect_timeout=CONNECT_S).close()
    except psycopg.OperationalError:
        return False
    return True


@cache
def own_database() -> str:
    """The URL of this process's database on the server, which is made if it is not there."""
    if WORKER is None:
        return POSTGRES
    url = make_url(POSTGRES)
    url = url.set(database=f"{url.database}_{WORKER}")
    with psycopg.connect(POSTGRES, autocommit=True, connect_timeout=CONNECT_S) as connection:
        try:
            connection.execute(f'CREATE DATABASE "{url.database}"')
        except psycopg.errors.DuplicateDatabase:
            pass
        except psycopg.errors.InsufficientPrivilege:
            return POSTGRES
    return url.render_as_string(hide_password=False)
