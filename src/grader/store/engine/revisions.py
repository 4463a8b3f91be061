"""The revisions of the tables, up and down. Alembic takes long to import, so it is imported only where tables have to
move: most commands find them current, and an empty SQLite file gets the newest tables at once."""

from functools import cache
from importlib import resources
from typing import TYPE_CHECKING

from sqlalchemy import Connection, inspect, text

from grader.errors import Conflict, Unprocessable

if TYPE_CHECKING:
    from alembic.config import Config


FOLDER = resources.files("grader.store.engine") / "migrations"

NEWEST_TABLES = FOLDER / "newest.sql"
"""The statements with which SQLite describes the newest tables, each followed by an empty line. They are those that all
revisions leave behind: `GRADER_TEST_REWRITE=1 pytest tests/store/test_migrations.py` writes them."""

IN_USE = 7_105_119
"""The first key of the PostgreSQL lock that the connections of servers and workers share; the second is their
schema."""

HOLD = f"SELECT pg_advisory_lock_shared({IN_USE}, hashtext(current_schema()))"
TRY_ALONE = f"SELECT pg_try_advisory_xact_lock({IN_USE}, hashtext(current_schema()))"


def find_current(connection: Connection) -> str | None:
    """The revision of the tables; None if there are none."""
    if not inspect(connection).has_table("alembic_version"):
        return None
    revision: str | None = connection.scalar(text("SELECT version_num FROM alembic_version"))
    return revision


@cache
def find_newest() -> str:
    """The newest revision that this version knows, by the names of the files: `v0010_erasure.py` makes 0010. A process
    keeps to what it found first: an upgrade may replace the files under it."""
    files = (FOLDER / "versions").iterdir()
    return max(file.name for file in files if file.name.startswith("v"))[1:5]


def list_revisions() -> list[str]:
    """The revisions that this version knows, oldest first."""
    from alembic.script import ScriptDirectory

    return [script.revision for script in ScriptDirectory.from_config(_config()).walk_revisions()][::-1]


def move(connection: Connection, target: str | None = None, *, beside_others: bool = False) -> None:
    """Brings the tables to the revision `target`, the newest if None, in the connection's transaction. Raises Conflict
    if a later version has written them, or if they are to go back while a server or worker lives, unless
    `beside_others`; and Unprocessable for an unknown target."""
    stored, wanted = find_current(connection), find_newest() if target is None else target
    if stored == wanted == find_newest():
        return
    if target is None and _is_empty_sqlite(connection):
        _create_newest(connection)
        return
    from alembic import command

    known = list_revisions()
    if stored is not None and stored not in known:
        raise Conflict(
            f"The database is at revision {stored}; this version knows those up to {known[-1]}. Install the version "
            f"that wrote it, or bring the database back with that version first: grader migrate {known[-1]}"
        )
    if wanted not in known:
        raise Unprocessable(f"There is no revision {wanted!r}. The revisions are {', '.join(known)}.")
    back = stored is not None and known.index(wanted) < known.index(stored)
    if back and not beside_others and connection.dialect.name != "sqlite" and not connection.scalar(text(TRY_ALONE)):
        raise Conflict(
            "Servers or workers work on this database, and would fail on earlier tables: stop them first. Those of a "
            "lost machine count until PostgreSQL ends their sessions; --yes does not look."
        )
    (command.downgrade if back else command.upgrade)(_config(connection), wanted)


def _is_empty_sqlite(connection: Connection) -> bool:
    """Whether the database is a SQLite file without any table."""
    return connection.dialect.name == "sqlite" and not connection.scalar(text("SELECT count(*) FROM sqlite_master"))


def _create_newest(connection: Connection) -> None:
    """Creates the newest tables and notes their revision."""
    for statement in NEWEST_TABLES.read_text(encoding="utf-8").rstrip(";\n").split(";\n\n"):
        connection.exec_driver_sql(statement)
    connection.execute(text("INSERT INTO alembic_version VALUES (:newest)"), {"newest": find_newest()})


def _config(connection: Connection | None = None) -> "Config":
    from alembic.config import Config

    config = Config()
    config.set_main_option("script_location", "grader.store.engine:migrations")
    config.attributes["connection"] = connection
    return config
