"""The owners of jobs in progress: each process that works is one, and the jobs of those that ended are released.
PostgreSQL: an owner holds an advisory lock in a session of its own. The server frees the lock with the session, so that
the jobs of a killed worker are released, and no clock of its machine decides who is alive. A lost session is not yet
the end of its owner, which has `GRACE_S` to take the lock again. SQLite: one process works on a database. What another
owner has claimed was left by an earlier process."""

import secrets
import time
from typing import Protocol

from sqlalchemy import Connection, func, select, text
from sqlalchemy.exc import DBAPIError
from sqlalchemy.orm import Session

from grader.queue import jobs
from grader.store.engine.database import Database

LOCKS = 7_105_115
"""The first key of the advisory locks of owners; the number is arbitrary."""

LIVE = 7_105_118
"""The first key of the lock that all owners share, so that they can be counted; the second is their schema."""

KEEPALIVE = {"tcp_keepalives_idle": 10, "tcp_keepalives_interval": 5, "tcp_keepalives_count": 3}
"""The server notices after 25 s that the machine of an owner is gone [s, s, probes]."""

GRACE_S = 5.0
"""How long an owner must be seen without its lock until its jobs are released [s]. One that lives looks more often, and
takes the lock again."""


SCHEMA = func.hashtext(func.current_schema())

WORKERS_ALIVE = text(
    "SELECT count(*) FROM pg_locks JOIN pg_database ON pg_database.oid = pg_locks.database "
    "WHERE locktype = 'advisory' AND granted AND datname = current_database() AND classid = :live AND objsubid = 2 "
    "AND objid = (hashtext(current_schema())::bigint & 4294967295)::oid"
)


def count_workers(session: Session) -> int:
    """Returns the number of owners on this PostgreSQL database and schema whose sessions live."""
    return session.scalar(WORKERS_ALIVE, {"live": LIVE}) or 0


class Owner(Protocol):
    """A process that works on jobs."""

    id: int

    def keep(self) -> None:
        """Proves that this owner is alive, and releases the jobs of those that are not. Call it every few seconds."""

    def close(self) -> None:
        """Ends the owner; jobs that it still has are released by another."""


def build_owner(database: Database) -> Owner:
    """Returns a new owner on this database."""
    return SqliteOwner(database) if database.is_sqlite else PostgresOwner(database)


class SqliteOwner:
    """The one process that works on a SQLite database."""

    def __init__(self, database: Database) -> None:
        self.id = secrets.randbits(31)
        self._database = database
        self._alone = False

    def keep(self) -> None:
        """Releases, once, what an earlier process has left."""
        if not self._alone:
            with self._database.write() as session:
                jobs.release(session, [lease for owner, lease in jobs.list_owned(session) if owner != self.id])
            self._alone = True

    def close(self) -> None:
        """Does nothing."""


class PostgresOwner:
    """An owner on PostgreSQL, alive while it holds its advisory lock."""

    def __init__(self, database: Database) -> None:
        self.id = secrets.randbits(31)
        self._database = database
        self._connection: Connection | None = None
        self._missed: dict[int, float] = {}
        """Since when each owner with jobs was seen without its lock, at every look."""

    def keep(self) -> None:
        """Takes the lock again if its session was lost, and releases the jobs of owners that were without a lock for
        `GRACE_S`. Raises DBAPIError while the database is away."""
        self._hold()
        with self._database.write() as session:
            others = {owner for owner, _ in jobs.list_owned(session)} - {self.id}
            seen_at = time.monotonic()
            self._missed = {
                owner: self._missed.get(owner, seen_at) for owner in others if self._has_ended(session, owner)
            }
            ended = {owner for owner, since in self._missed.items() if seen_at - since >= GRACE_S}
            jobs.release(session, [lease for owner, lease in jobs.list_owned(session) if owner in ended])

    def close(self) -> None:
        """Ends the session, and with it the lock."""
        if self._connection is not None:
            self._connection.invalidate()
            self._connection.close()
            self._connection = None

    def _hold(self) -> None:
        if self._connection is not None:
            try:
                self._connection.execute(text("SELECT 1"))
                return
            except DBAPIError:
                self.close()
        self._missed.clear()  # what has cost us our session may have cost the others theirs, a moment ago
        connection = self._database.engine.connect().execution_options(isolation_level="AUTOCOMMIT")
        self._connection = connection
        for name, value in KEEPALIVE.items():
            connection.execute(select(func.set_config(name, str(value), False)))
        # False while the server has not noticed the end of our last session, whose lock still holds.
        if not connection.scalar(select(func.pg_try_advisory_lock(LOCKS, self.id))):
            self.close()
            return
        connection.execute(select(func.pg_advisory_lock_shared(LIVE, SCHEMA)))

    def _has_ended(self, session: Session, owner: int) -> bool:
        return bool(session.scalar(select(func.pg_try_advisory_xact_lock(LOCKS, owner))))
