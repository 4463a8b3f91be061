"""The revisions of the tables, up and down."""

from alembic import command
from alembic.config import Config
from alembic.runtime.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import Connection

from grader.errors import Conflict, Unprocessable


def current(connection: Connection) -> str | None:
    """The revision of the tables; None if there are none."""
    return MigrationContext.configure(connection).get_current_revision()


def revisions() -> list[str]:
    """The revisions that this version knows, oldest first."""
    found = ScriptDirectory.from_config(_config()).walk_revisions()
    return [script.revision for script in found][::-1]


def move(connection: Connection, target: str | None = None) -> None:
    """Brings the tables to the revision `target`, the newest if None, in the connection's transaction.

    Raises Conflict if a later version has written them, and Unprocessable for an unknown target.
    """
    known, stored = revisions(), current(connection)
    newest = known[-1]
    wanted = newest if target is None else target
    if stored is not None and stored not in known:
        raise Conflict(
            f"The database is at revision {stored}; this version knows those up to {newest}. Install the version that "
            f"wrote it, or bring the database back with that version first: grader migrate {newest}"
        )
    if wanted not in known:
        raise Unprocessable(f"There is no revision {wanted!r}. The revisions are {', '.join(known)}.")
    back = stored is not None and known.index(wanted) < known.index(stored)
    (command.downgrade if back else command.upgrade)(_config(connection), wanted)


def _config(connection: Connection | None = None) -> Config:
    config = Config()
    config.set_main_option("script_location", "grader.store:migrations")
    config.attributes["connection"] = connection
    return config
