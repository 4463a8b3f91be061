"""Says why a database cannot be used, and the cure where that is known. For commands and the start of a server, whose
users may know what the driver says."""

import os
import re
import shlex
import shutil
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from getpass import getuser
from pathlib import Path

from sqlalchemy import URL, make_url
from sqlalchemy.exc import DBAPIError, ProgrammingError
from sqlalchemy.exc import TimeoutError as PoolTimeoutError

from grader.errors import NotReady
from grader.store.engine.database import FREE_BYTES_MIN, FULL, find_away

RESTORE = "Put a backup in its place, as docs/operating.md says."

DAMAGED = (sqlite3.SQLITE_NOTADB, sqlite3.SQLITE_CORRUPT)

NO_RIGHT = "42501"
"""The code of insufficient_privilege."""


@contextmanager
def naming(url: str) -> Iterator[None]:
    """Makes what is raised within while the database at `url` is away, locked, full, read-only, damaged or another's a
    NotReady that names it, without a password. For commands, whose users may know what the driver says."""
    try:
        yield
    except (DBAPIError, PoolTimeoutError) as error:
        why = explain(make_url(url), error)
        if why is None:
            raise
        raise NotReady(why) from error


def explain(url: URL, error: DBAPIError | PoolTimeoutError) -> str | None:
    """Says why the database cannot be used, and the cure where that is known; None if a statement is at fault."""
    cause, away = getattr(error, "orig", None), find_away(error)
    if getattr(cause, "sqlite_errorcode", None) in DAMAGED:
        return f"{url.database} is damaged, or no database: {cause}. {RESTORE}"
    if getattr(cause, "sqlstate", None) == NO_RIGHT:
        return explain_rights(url, error)
    if url.get_backend_name() == "sqlite" and away is not None and lacks_room(url):
        return f"{FULL} Make room for {url.database}."
    # What psycopg itself refuses before it connects, such as a timeout that is no number, has no code.
    if away is None and not (isinstance(error, ProgrammingError) and getattr(cause, "sqlstate", "") is None):
        return None
    why = put_on_a_line(getattr(away, "orig", None) or away or cause)
    cure = find_cure(url, why)
    return f"The database {describe_place(url)} cannot be used: {why}{f'. {cure}' if cure else ''}"


def explain_rights(url: URL, error: DBAPIError | PoolTimeoutError) -> str:
    """Says what the role of the URL may not do, and the cure."""
    role, name = find_role(url), url.database
    if not str(getattr(error, "statement", None)).lstrip().startswith("CREATE"):
        why = put_on_a_line(getattr(error, "orig", None))
        return f"The role {role} may not use what is in {name}: {why}. Log in as the owner of its tables."
    return (
        f"The role {role} may not make tables in {name}: make it the owner "
        f"(`ALTER DATABASE {quote_name(name)} OWNER TO {quote_name(role)}`)."
    )


def find_cure(url: URL, why: str) -> str | None:
    """The command that makes the role or the database that PostgreSQL says is not there; None for any other reason.
    Without a session there is no code of an error, and a server may speak another language than English: then the
    quotes of that language stand about the name, and the cure is for the case that it is not there."""
    role, name = find_role(url), url.database or ""
    make_role = f"createuser --pwprompt {shlex.quote(role)}"
    make_database = f"createdb --owner={shlex.quote(role)} {shlex.quote(name)}"
    if f'role "{role}" does not exist' in why:
        return f"Make the role, as PostgreSQL's administrator: {make_role}"
    if f'database "{name}" does not exist' in why:
        return f"Make the database, as PostgreSQL's administrator: {make_database}"
    if f'authentication failed for user "{role}"' in why:
        return f"Mend the password, or make the role, as PostgreSQL's administrator: {make_role}"
    cures = ((role, make_role), (name, make_database))
    named = [cure for of, cure in cures if re.search(rf"[«»„“‘‚]\s?{re.escape(of)}\s?[«»“”’‘]", why)]
    return f"If it is not there, as PostgreSQL's administrator: {' or '.join(named)}" if named else None


def find_role(url: URL) -> str:
    """The role that logs in: without one in the URL, that of the variable or the user of the system, as in libpq."""
    named = url.username or url.query.get("user") or os.environ.get("PGUSER") or getuser()
    return named if isinstance(named, str) else named[-1]


def quote_name(name: str | None) -> str:
    """A name as SQL takes it, quoted where it must be."""
    return name if name and re.fullmatch("[a-z_][a-z0-9_]*", name) else '"' + (name or "").replace('"', '""') + '"'


def put_on_a_line(error: object) -> str:
    """The text of an error without line ends."""
    return " ".join(str(error).split())


def lacks_room(url: URL) -> bool:
    """Whether the disk of a SQLite file is full."""
    return shutil.disk_usage(Path(url.database or ".").parent).free < FREE_BYTES_MIN


def describe_place(url: URL) -> str:
    """Says where a database is: its file, or its host, port and name."""
    if url.get_backend_name() == "sqlite":
        return str(url.database)
    host = url.query.get("host") or f"{url.host or 'localhost'}:{url.port or 5432}"
    return f"{host}/{url.database}"
