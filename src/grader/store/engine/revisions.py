"""The revisions of the tables, up and down. Alembic takes long to import, so it is imported only where tables have to
move: most commands find them current."""

from importlib import resources
from typing import TYPE_CHECKING

from sqlalchemy import Connection, inspect, text

from grader.errors import Conflict, Unprocessable

if TYPE_CHECKING:
    from alembic.config import Config


def current(connection: Connection) -> str | None:
    """The revision of the tables; None if there are none."""
    if not inspect(connection).has_table("alembic_version"):
        return None
    revision: str | None = connection.scalar(text("SELECT version_num FROM alembic_version"))
    return revision


def newest() -> str:
    """The newest revision that this version knows, by the names of the files: `v0010_erasure.py` makes 0010."""
    files = (resources.files("grader.store.engine") / "migrations" / "versions").iterdir()
    return max(file.name for file in files if file.name.startswith("v"))[1:5]


def revisions() -> list[str]:
    """The revisions that this version knows, oldest first."""
    from alembic.script import ScriptDirectory

    return [script.revision for script in ScriptDirectory.from_config(_config()).walk_revisions()][::-1]


def move(connection: Connection, target: str | None = None) -> None:
    """Brings the tables to the revision `target`, the newest if None, in the connection's transaction. Raises Conflict
    if a later version has written them, and Unprocessable for an unknown target."""
    stored, wanted = current(connection), newest() if target is None else target
    if stored == wanted == newest():
        return
    from alembic import command

    known = revisions()
    if stored is not None and stored not in known:
        raise Conflict(
            f"The database is at revision {stored}; this version knows those up to {newest()}. Install the version "
            f"that wrote it, or bring the database back with that version first: grader migrate {newest()}"
        )
    if wanted not in known:
        raise Unprocessable(f"There is no revision {wanted!r}. The revisions are {', '.join(known)}.")
    back = stored is not None and known.index(wanted) < known.index(stored)
    (command.downgrade if back else command.upgrade)(_config(connection), wanted)


def _config(connection: Connection | None = None) -> "Config":
    from alembic.config import Config

    config = Config()
    config.set_main_option("script_location", "grader.store.engine:migrations")
    config.attributes["connection"] = connection
    return config
