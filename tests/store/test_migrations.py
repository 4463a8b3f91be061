"""The tables go up and down through every revision with rows in all of them, on both databases."""

import os
from contextlib import closing
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import Column, Connection, MetaData, Table, inspect, text
from sqlalchemy.types import Boolean, DateTime, Float, Integer, LargeBinary, String

from grader.errors import Conflict, Unprocessable
from grader.store.engine import revisions
from grader.store.engine.database import Database
from support.databases import BACKENDS, database_url

pytestmark = pytest.mark.slow

THEN = datetime(2026, 9, 1, 12, tzinfo=UTC)
SAME = {("members", "id"): "learner", ("credentials", "member"): "learner", ("jobs", "subject"): "id"}
"""Columns whose values are those of another column, without a foreign key that says so."""
ROWS = 2
LASTING = (
    "SELECT submissions.id, answer, verdicts.body FROM submissions JOIN verdicts ON submission_id = submissions.id"
)


@pytest.fixture(params=BACKENDS)
def database(request: pytest.FixtureRequest, tmp_path: Path) -> Any:
    with database_url(request.param, tmp_path, empty=True) as url:
        database = Database(url)
        yield database
        database.close()


def value(column: Column[Any], number: int) -> Any:
    """A value for row `number` that agrees with those of the rows that it belongs to."""
    assert column.table is not None
    for key in column.foreign_keys:
        return value(key.column, number)
    if isinstance(column.type, Boolean):
        return True
    if isinstance(column.type, Integer):
        return number
    if isinstance(column.type, Float):
        return number / 2
    if isinstance(column.type, DateTime):
        return THEN if column.type.timezone else THEN.replace(tzinfo=None)
    if isinstance(column.type, LargeBinary):
        return b"secret"
    assert isinstance(column.type, String)
    return f"{SAME.get((str(column.table), column.name), column.name)}-{number}"


def tables_of(connection: Connection) -> list[Table]:
    """The tables as they are now."""
    tables = MetaData()
    tables.reflect(connection)
    return [table for table in tables.sorted_tables if table.name != "alembic_version"]


def fill(connection: Connection, filled: list[Table] | None = None) -> list[Table]:
    """Adds rows to these tables, or to every one."""
    filled = tables_of(connection) if filled is None else filled
    for table in filled:
        rows = [{column.name: value(column, number + 1) for column in table.columns} for number in range(ROWS)]
        connection.execute(table.insert(), rows)
    return filled


def shape(connection: Connection) -> dict[str, Any]:
    """Columns, keys, indices and triggers of every table; the order of columns does not matter."""
    seen = inspect(connection)
    by_table: dict[str, Any] = {}
    for table in seen.get_table_names():
        columns = {column["name"]: (str(column["type"]), column["nullable"]) for column in seen.get_columns(table)}
        keys = sorted(
            (*key["constrained_columns"], key["referred_table"], *key["referred_columns"])
            for key in seen.get_foreign_keys(table)
        )
        unique = sorted(tuple(constraint["column_names"]) for constraint in seen.get_unique_constraints(table))
        indices = {
            index["name"]: (index["column_names"], index["unique"], sorted(map(str, index["dialect_options"].values())))
            for index in seen.get_indexes(table)
        }
        primary = sorted(seen.get_pk_constraint(table)["constrained_columns"])
        by_table[table] = (columns, primary, keys, unique, indices)
    triggers = {
        "sqlite": "SELECT name, sql FROM sqlite_master WHERE type = 'trigger'",
        "postgresql": "SELECT tgname, pg_get_triggerdef(pg_trigger.oid) FROM pg_trigger JOIN pg_class "
        "ON pg_class.oid = tgrelid WHERE NOT tgisinternal AND relnamespace = current_schema()::regnamespace",
    }
    by_table["triggers"] = sorted(map(tuple, connection.execute(text(triggers[connection.dialect.name]))))
    return by_table


def test_the_newest_revision_is_read_off_the_names_of_the_files() -> None:
    assert revisions.find_newest() == revisions.list_revisions()[-1]


def test_an_empty_sqlite_file_gets_the_very_tables_that_all_revisions_make(tmp_path: Path) -> None:
    made = text("SELECT sql FROM sqlite_master WHERE sql IS NOT NULL ORDER BY sql LIKE 'CREATE TABLE%' DESC, name")
    statements: dict[str, list[str]] = {}
    ways: dict[str, list[Any]] = {"one by one": revisions.list_revisions(), "at once": [None]}
    for way, targets in ways.items():
        with closing(Database(f"sqlite:///{tmp_path / way}.db")) as database:
            for target in targets:
                database.migrate(target)
            with database.engine.connect() as connection:
                statements[way] = [*map(str, connection.scalars(made))]
                assert revisions.find_current(connection) == revisions.find_newest()
                shapes = shape(connection)
        if way == "one by one" and os.environ.get("GRADER_TEST_REWRITE"):
            Path(str(revisions.NEWEST_TABLES)).write_text(";\n\n".join(statements[way]) + ";\n", encoding="utf-8")
    assert len(shapes) > 30
    assert statements["at once"] == statements["one by one"], "run this test with GRADER_TEST_REWRITE=1"


def test_every_revision_down_and_up_again_with_rows_in_every_table(database: Database) -> None:
    shapes: dict[str, Any] = {}
    for revision in revisions.list_revisions():
        database.migrate(revision)
        with database.engine.connect() as connection:
            shapes[revision] = shape(connection)
    with database.write() as session:
        connection = session.connection()
        assert len(fill(connection)) == len(shapes[revision]) - 2  # the triggers and Alembic's own
        lasting = list(connection.execute(text(LASTING)))
    for revision in [*revisions.list_revisions()[::-1], *revisions.list_revisions()]:
        database.migrate(revision)
        with database.engine.connect() as connection:
            assert revisions.find_current(connection) == revision
            assert shape(connection) == shapes[revision]
            assert connection.execute(text(LASTING)).all() == lasting
            assert connection.scalar(text("SELECT count(*) FROM jobs")) == ROWS
            if database.is_sqlite:
                assert connection.execute(text("PRAGMA foreign_key_check")).all() == []


def test_a_server_that_still_runs_reads_and_writes_the_tables_of_a_later_one(database: Database) -> None:
    """docs/deploy.md promises it from this revision on, for an upgrade without an interruption."""
    database.migrate("0008")
    with database.engine.connect() as connection:
        known = tables_of(connection)
    database.migrate()
    with database.write() as session:
        fill(session.connection(), known)
    with database.read() as session:
        assert [len(session.execute(table.select()).all()) for table in known] == [ROWS] * len(known)


def test_learners_of_one_name_stay_apart_where_names_tell_them_apart(database: Database) -> None:
    database.migrate()
    with database.write() as session:
        fill(session.connection())
        session.execute(text("UPDATE members SET name = 'Eve', course = 'c', account = NULL"))
    database.migrate("0004")
    with database.read() as session:
        names = set(session.scalars(text('SELECT "user" FROM submissions')))
    assert len(names) == ROWS
    assert all(name.startswith("Eve") for name in names)


def test_a_database_of_a_later_version_is_refused_with_what_to_do(database: Database) -> None:
    database.migrate()
    with database.write() as session:
        session.execute(text("UPDATE alembic_version SET version_num = '9999'"))
    with pytest.raises(Conflict, match=r"is at revision 9999.*grader migrate \d{4}"):
        database.migrate()
    with database.read() as session:
        assert session.scalar(text("SELECT version_num FROM alembic_version")) == "9999"


def test_an_unknown_revision_is_refused(database: Database) -> None:
    with pytest.raises(Unprocessable, match="no revision '1234'"):
        database.migrate("1234")


def test_the_file_of_a_database_is_its_owners_alone(tmp_path: Path) -> None:
    folder = tmp_path / "data"
    database = Database(f"sqlite:///{folder / 'grader.db'}")
    database.migrate()
    modes = {path.name: path.stat().st_mode & 0o777 for path in (folder, *folder.iterdir())}
    database.close()
    assert modes == {"data": 0o700, "grader.db": 0o600, "grader.db-wal": 0o600, "grader.db-shm": 0o600}
