"""A copy of a SQLite database, made while it is in use."""

import os
import sqlite3
from contextlib import closing
from pathlib import Path

from sqlalchemy import make_url

from grader.errors import Conflict, NotFound, NotReady, Unprocessable


def back_up(url: str, target: Path) -> None:
    """Writes the database at `url`, as it is at one moment, to the new file `target`. Servers go on reading and
    writing. The file appears whole or not at all, for its owner alone: the key of the hidden cases is in it. Raises
    Unprocessable on PostgreSQL, NotFound where there is no database or no folder, Conflict if the file exists, and
    NotReady where the database cannot be read or the disk of the copy is full, of which no part is left."""
    parsed = make_url(url)
    if parsed.get_backend_name() != "sqlite":
        raise Unprocessable("PostgreSQL makes its own backups: pg_dump --format=custom --file=FILE NAME")
    source = Path(parsed.database or "")
    if not source.is_file():
        raise NotFound(f"There is no database {source}: name its folder with --data or GRADER_DATA.")
    if target.exists():
        raise Conflict(f"{target} exists: name a new file.")
    if not target.parent.is_dir():
        raise NotFound(f"There is no folder {target.parent}.")
    part = target.with_name(f"{target.name}.part")
    os.close(os.open(part, os.O_CREAT | os.O_TRUNC | os.O_WRONLY, 0o600))
    try:
        # VACUUM INTO reads in one transaction, and leaves out what was deleted; it does not sync what it wrote.
        with closing(sqlite3.connect(source)) as connection:
            connection.execute("VACUUM INTO ?", (str(part),))
        _sync(part)
    except (sqlite3.OperationalError, OSError) as error:
        part.unlink()
        raise NotReady(f"The database {source} cannot be copied to {target}: {error}") from error
    part.rename(target)
    _sync(target.parent)


def _sync(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
