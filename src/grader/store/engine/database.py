"""One database, SQLite or PostgreSQL: transactions for reading and for writing, and its migrations."""

import os
import select
import shutil
import sqlite3
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, nullcontext, suppress
from math import inf
from pathlib import Path
from threading import Lock
from typing import Any

from sqlalchemy import URL, Connection, Engine, create_engine, event, make_url, text
from sqlalchemy.exc import DBAPIError, InterfaceError, InvalidatePoolError, OperationalError
from sqlalchemy.exc import TimeoutError as PoolTimeoutError
from sqlalchemy.orm import Session
from sqlalchemy.pool import QueuePool

from grader.errors import NotReady
from grader.store.engine import revisions
from grader.store.engine.names import fold_name
from grader.store.engine.signals import PENDING, Signals

CONNECTIONS = 64
"""Connections that a database may have at once, with default settings; PostgreSQL itself allows 100."""

KEPT = 16
"""So many of them stay open."""

BUSY_S = 30.0
"""How long SQLite waits for the lock of another process [s]."""

CHECKPOINT_PAGES = 4000
"""Pages of SQLite's log, of 4 KB each, that are moved into its file together. A class that answers changes the same
pages again and again, and each move waits for the disk."""

AWAY = (OperationalError, InterfaceError, PoolTimeoutError)
"""What SQLAlchemy raises while a database is away, locked, full or read-only."""

IDLE_S = 1.0
"""After so long without use a pooled connection of PostgreSQL is asked whether it still works [s]."""

FREE_BYTES_MIN = 16 << 20
"""Less room than this on the disk of a SQLite database counts as none: the largest answers take megabytes."""

FULL = f"The disk of the database is full: less than {FREE_BYTES_MIN >> 20} MB are free."

READ_ONLY = "25006"
"""The code of PostgreSQL's error read_only_sql_transaction."""

OTHER_TABLES = ("42P01", "42703")
"""The codes of undefined_table and undefined_column: the tables are of another revision."""

PATIENCE = {"connect_timeout": 5, "tcp_user_timeout": 10_000}
"""How long PostgreSQL may not answer before it counts as away: a connection [s], what was sent over one [ms]."""

MIGRATION_LOCK = 7_105_114_101
"""The PostgreSQL advisory lock for migrations; the number is arbitrary."""

SESSION = text("SELECT pid || ' ' || backend_start FROM pg_stat_activity WHERE pid = pg_backend_pid()")
"""Names a process of PostgreSQL; the time tells those of two machines apart."""

ANALYZED_AT = (100, 1_000, 10_000)
"""Numbers of stored answers after which PostgreSQL gathers statistics at once."""

LOCK_ALL = text(
    "SELECT set_config('plan_cache_mode', 'force_generic_plan', true), set_config('enable_seqscan', 'off', true), "
    "set_config('enable_hashjoin', 'off', true), set_config('enable_mergejoin', 'off', true), "
    "count(pg_advisory_xact_lock(key)) FROM (SELECT DISTINCT hashtextextended(name, 0) AS key "
    "FROM unnest(CAST(:names AS text[])) AS name ORDER BY key) AS keys"
)
"""Takes locks in the order of their keys, so that two transactions cannot wait for each other. Up to its end PostgreSQL
looks up each row by an index, and plans a prepared statement once. By itself it plans the query for some new answers
each time anew, and reads whole tables of thousands of answers to find those of a few learners: in a batch of 25 answers
beside 10,000 others that took ten milliseconds, and takes two."""


class Database:
    """Sessions on one database. `read()` and `write()` are transactions; nothing else commits."""

    def __init__(self, url: str, connections: int = CONNECTIONS) -> None:
        """Opens `url` (`sqlite:///PATH` or `postgresql://...`), creating the folder of a SQLite file. Threads beyond
        the number of `connections` wait for one."""
        parsed = make_url(url)
        if parsed.drivername == "postgresql":
            parsed = parsed.set(drivername="postgresql+psycopg")
        self.is_sqlite = parsed.get_backend_name() == "sqlite"
        if self.is_sqlite and parsed.database:
            _create_private(Path(parsed.database))
        kept = min(connections, KEPT)
        # Last in, first out: few connections are in use, and those have prepared their statements.
        self.engine = create_engine(
            parsed, poolclass=QueuePool, pool_size=kept, max_overflow=connections - kept, pool_use_lifo=True,
            connect_args=patience_with(parsed), hide_parameters=True,
        )  # fmt: skip
        if self.is_sqlite:
            _set_up_sqlite(self.engine)
        else:
            _set_up_postgresql(self.engine)
        self.signals = Signals(self.engine, self.is_sqlite)
        self._reader = self.engine if self.is_sqlite else self.engine.execution_options(postgresql_readonly=True)
        self._writer = self.engine.execution_options(writes=True)
        self._hasty = self.engine.execution_options(writes=True, hasty=True)
        self._stored = 0
        # SQLite's own wait for a lock sleeps in steps; within one process a queue of threads is fair and quicker.
        self._turn = Lock() if self.is_sqlite else nullcontext()

    @property
    def backend(self) -> str:
        """`sqlite` or `postgresql`."""
        return self.engine.url.get_backend_name()

    @contextmanager
    def read(self) -> Iterator[Session]:
        """A transaction for reading, which stores nothing. PostgreSQL refuses changes in it. There it ends with a
        COMMIT: after a ROLLBACK psycopg forgets the statements that it has prepared."""
        with Session(self._reader, autoflush=False) as session:
            yield session
            if not self.is_sqlite:
                session.expunge_all()  # objects that were changed are not flushed
                session.commit()

    @contextmanager
    def write(self, *, hasty: bool = False) -> Iterator[Session]:
        """A transaction for writing: committed at the end, rolled back after an error. Its signals are sent with it. A
        `hasty` commit does not wait for the disk: a power cut may undo it, whole."""
        with Session(self._hasty if hasty else self._writer, expire_on_commit=False) as session:
            with self._turn, session.begin():
                yield session
                if PENDING in session.info:
                    self.signals.before_commit(session)
            if PENDING in session.info:
                self.signals.after_commit(session)

    def lock(self, session: Session, name: str) -> None:
        """Holds a lock of this name until the transaction ends. On SQLite there is only one writer anyway."""
        if not self.is_sqlite:
            session.execute(text("SELECT pg_advisory_xact_lock(hashtextextended(:name, 0))"), {"name": name})

    def lock_learner(self, session: Session, course: str, learner: str) -> None:
        """As `lock`, for what depends on all answers of one learner: attempts and results."""
        self.lock(session, f"{course}\n{learner}")

    def lock_learners(self, session: Session, learners: Iterable[tuple[str, str]]) -> None:
        """As `lock_learner`, for several (course, learner) at once. The rest of the transaction finds rows by
        their keys, not by reading tables."""
        if not self.is_sqlite:
            session.connection().execute(LOCK_ALL, {"names": [f"{course}\n{learner}" for course, learner in learners]})

    def tell_planner(self, session: Session, stored: int) -> None:
        """Has PostgreSQL gather statistics after the first answers that this process stores, in the transaction. Its
        autovacuum looks once a minute. Without statistics it takes any index for as good as another, and reads the
        answers of all learners to find those of one."""
        before, self._stored = self._stored, self._stored + stored
        if not self.is_sqlite and any(before < step <= self._stored for step in ANALYZED_AT):
            session.execute(text("ANALYZE submissions, verdicts, results"))

    @property
    def free_bytes(self) -> int | None:
        """Free bytes on the disk of a SQLite file; None on PostgreSQL, whose own machine has it."""
        file = self.engine.url.database
        return shutil.disk_usage(Path(file).parent).free if self.is_sqlite and file else None

    def check(self) -> None:
        """Writes a row as it is. Raises what `write` raises if the database is away, full or read-only, and NotReady if
        the tables are of an earlier revision than this version needs. Later ones will do: servers of two versions stand
        side by side during an upgrade."""
        with self.write() as session:
            update = text("UPDATE alembic_version SET version_num = version_num RETURNING version_num")
            stored, needed = session.scalar(update), revisions.find_newest()
        if stored is None or stored < needed:
            raise NotReady(
                f"The tables are of revision {stored or 'none'}, this version needs {needed}: restart the server to "
                "bring them there, or install the earlier version."
            )

    def hold(self) -> None:
        """Has every connection from now on say that a server or worker lives, until it is closed: the tables are not
        brought back under it."""
        if not self.is_sqlite:
            event.listen(self.engine, "connect", _hold_tables)
            self.engine.dispose()  # those that were opened before
            self.engine.connect().close()

    def keeps_sessions(self) -> bool:
        """Whether a connection has a session of PostgreSQL to itself. It has not with a pooler in transaction mode. Two
        connections that are open at once must each stay with a process of their own. Each asks twice in a row, so that
        poolers that take the one used last, and those that take the one used first, are both recognized."""
        if self.is_sqlite:
            return True
        alone = self.engine.execution_options(isolation_level="AUTOCOMMIT")
        with alone.connect() as one, alone.connect() as other:
            sessions = [connection.scalar(SESSION) for connection in (one, one, other, other, one, one)]
        return len({*sessions[:2], *sessions[4:]}) == len({*sessions[2:4]}) == 1 and sessions[0] != sessions[2]

    def migrate(self, revision: str | None = None, *, beside_others: bool = False) -> None:
        """Brings the tables to a revision, the newest if None; safe to call from several processes at once. Raises
        Conflict if a later version has written them, or if they are to go back while a server or worker lives on
        PostgreSQL, unless `beside_others`; and Unprocessable for an unknown revision."""
        with self._turn, self._writer.connect() as connection, _foreign_keys_off(connection), connection.begin():
            if not self.is_sqlite:
                connection.execute(text("SELECT pg_advisory_xact_lock(:lock)"), {"lock": MIGRATION_LOCK})
            revisions.move(connection, revision, beside_others=beside_others)

    @property
    def revision(self) -> str | None:
        """The revision of the tables; None if there are none."""
        with self.engine.connect() as connection:
            return revisions.find_current(connection)

    def empty_log(self) -> None:
        """Moves SQLite's write-ahead log into its file, so that nothing deleted is left in it; else does nothing."""
        if self.is_sqlite:
            with self.engine.connect() as connection:
                driver: Any = connection.connection
                driver.execute("PRAGMA wal_checkpoint(TRUNCATE)")

    def close(self) -> None:
        """Closes every connection."""
        self.signals.close()
        self.engine.dispose()


def patience_with(url: URL) -> dict[str, Any]:
    """The driver's arguments that say how long it waits; what the URL says itself stays."""
    if url.get_backend_name() == "sqlite":
        return {"timeout": BUSY_S}
    return {name: value for name, value in PATIENCE.items() if name not in url.query}


def is_away(error: BaseException) -> bool:
    """Whether an error means that the database cannot serve now, and no fault of a statement: 503, not 500."""
    return find_away(error) is not None


def find_away(error: BaseException) -> BaseException | None:
    """Returns the error that says so: this one, or the one behind it."""
    cause = error.orig if isinstance(error, DBAPIError) else None
    if isinstance(cause, sqlite3.OperationalError) and cause.sqlite_errorcode == sqlite3.SQLITE_ERROR:
        # On a full disk SQLite ends the whole transaction, and the way back to a savepoint then fails.
        return None if cause.__context__ is None else find_away(cause.__context__)
    return error if isinstance(error, AWAY) or getattr(cause, "sqlstate", None) == READ_ONLY else None


def is_of_other_tables(error: BaseException) -> bool:
    """Whether a statement failed on PostgreSQL because the tables are not those of this version."""
    return isinstance(error, DBAPIError) and getattr(error.orig, "sqlstate", None) in OTHER_TABLES


def driver_error(error: Exception) -> str:
    """The name of the driver's error, such as SQLITE_FULL or DiskFull: its text may hold names of hosts."""
    cause = getattr(error, "orig", None) or error
    return str(getattr(cause, "sqlite_errorname", type(cause).__name__))


@contextmanager
def _foreign_keys_off(connection: Connection) -> Iterator[None]:
    """Lets migrations rebuild tables that others refer to, as SQLite asks for it; nothing on PostgreSQL. Source:
    https://www.sqlite.org/lang_altertable.html, section 7. The switch works outside of transactions only."""
    if connection.dialect.name != "sqlite":
        yield
        return
    driver: Any = connection.connection
    driver.execute("PRAGMA foreign_keys = OFF")
    try:
        yield
    finally:
        driver.execute("PRAGMA foreign_keys = ON")


def _create_private(path: Path) -> None:
    """Creates a database file that only its owner can read, in a folder of the same kind, unless it is there."""
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    with suppress(FileExistsError):  # an existing file is not opened: closing it would end SQLite's locks on it
        os.close(os.open(path, os.O_CREAT | os.O_EXCL, 0o600))


def _set_up_postgresql(engine: Engine) -> None:
    """Switches the compilation of plans off: it takes tenths of a second, and our queries take milliseconds. A pooled
    connection is asked whether it still works only if it was idle, or if its socket has something to read, such as the
    news that the server has ended it: to ask every time is one more round trip in every transaction."""

    @event.listens_for(engine, "connect")
    def on_connect(connection: Any, _record: Any) -> None:
        connection.execute("SET jit = off")
        connection.commit()

    @event.listens_for(engine, "checkin")
    def on_checkin(_connection: Any, record: Any) -> None:
        record.info["used"] = time.monotonic()

    @event.listens_for(engine, "checkout")
    def on_checkout(connection: Any, record: Any, _fairy: Any) -> None:
        idle_s = time.monotonic() - record.info.get("used", -inf)
        if idle_s > IDLE_S or _has_news(connection):
            try:
                engine.dialect.do_ping(connection)
            except connection.Error as error:
                raise InvalidatePoolError from error

    @event.listens_for(engine, "begin")
    def on_begin(connection: Connection) -> None:
        if connection.get_execution_options().get("hasty", False):
            connection.exec_driver_sql("SET LOCAL synchronous_commit = off")


def _hold_tables(connection: Any, _record: Any) -> None:
    """Holds the lock of servers and workers for as long as the session lives."""
    connection.execute(revisions.HOLD)
    connection.commit()


def _has_news(connection: Any) -> bool:
    """Whether an idle connection of PostgreSQL was closed, or has something to read."""
    if connection.closed:
        return True
    socket = select.poll()
    socket.register(connection.fileno(), select.POLLIN)
    return bool(socket.poll(0))


def _set_up_sqlite(engine: Engine) -> None:
    """Sets WAL, durable commits, foreign keys and functions, and begins transactions: the driver's own miss DDL."""

    @event.listens_for(engine, "connect")
    def on_connect(connection: Any, _record: Any) -> None:
        connection.isolation_level = None
        for pragma in (
            "journal_mode = WAL", "synchronous = FULL", "foreign_keys = ON", f"wal_autocheckpoint = {CHECKPOINT_PAGES}"
        ):  # fmt: skip
            connection.execute(f"PRAGMA {pragma}")
        connection.create_function("folded", 1, fold_name, deterministic=True)

    @event.listens_for(engine, "begin")
    def on_begin(connection: Connection) -> None:
        # A writer takes the lock at once: a reader that turns writer halfway would fail instead of waiting.
        options = connection.get_execution_options()
        if (hasty := options.get("hasty", False)) != connection.info.get("hasty", False):
            connection.exec_driver_sql(f"PRAGMA synchronous = {'NORMAL' if hasty else 'FULL'}")
            connection.info["hasty"] = hasty
        connection.exec_driver_sql("BEGIN IMMEDIATE" if options.get("writes", False) else "BEGIN")
