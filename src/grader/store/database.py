"""One database, SQLite or PostgreSQL: transactions for reading and for writing, and its migrations."""

from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from threading import Lock
from typing import Any

from sqlalchemy import Connection, Engine, create_engine, event, make_url, text
from sqlalchemy.orm import Session
from sqlalchemy.pool import QueuePool

BUSY_S = 30.0
"""How long a writer waits for another process before SQLite gives up [s]."""

MIGRATION_LOCK = 7_105_114_101
"""Any number: the PostgreSQL advisory lock under which one process at a time migrates."""


class Database:
    """Sessions on one database. `read()` and `write()` are transactions: no commit stands anywhere else."""

    def __init__(self, url: str) -> None:
        """Opens `url` (`sqlite:///PATH` or `postgresql://...`); the folder of a SQLite file is made."""
        parsed = make_url(url)
        if parsed.drivername == "postgresql":
            parsed = parsed.set(drivername="postgresql+psycopg")
        self.is_sqlite = parsed.get_backend_name() == "sqlite"
        if self.is_sqlite and parsed.database:
            Path(parsed.database).parent.mkdir(parents=True, exist_ok=True)
        connect_args: dict[str, Any] = {"timeout": BUSY_S} if self.is_sqlite else {}
        self.engine = create_engine(
            parsed, poolclass=QueuePool, pool_size=16, max_overflow=48, pool_pre_ping=not self.is_sqlite,
            connect_args=connect_args,
        )  # fmt: skip
        if self.is_sqlite:
            _set_up_sqlite(self.engine)
        self._writer = self.engine.execution_options(writes=True)
        # SQLite's own wait for a lock sleeps in steps; within one process a queue of threads is fair and quicker.
        self._turn = Lock() if self.is_sqlite else nullcontext()

    @property
    def backend(self) -> str:
        """`sqlite` or `postgresql`."""
        return self.engine.url.get_backend_name()

    @contextmanager
    def read(self) -> Iterator[Session]:
        """One consistent view; nothing is kept."""
        with Session(self.engine, autoflush=False) as session:
            yield session

    @contextmanager
    def write(self) -> Iterator[Session]:
        """One transaction: committed as a whole at the end, or not at all."""
        with self._turn, Session(self._writer, expire_on_commit=False) as session, session.begin():
            yield session

    def lock(self, session: Session, name: str) -> None:
        """Makes transactions that name the same thing wait for each other; on SQLite all writers do already."""
        if not self.is_sqlite:
            session.execute(text("SELECT pg_advisory_xact_lock(hashtextextended(:name, 0))"), {"name": name})

    def ping(self) -> None:
        """Raises where the database does not answer."""
        with self.engine.connect() as connection:
            connection.execute(text("SELECT 1"))

    def migrate(self) -> None:
        """Brings the tables up to date; safe to call from several processes at once."""
        with self._turn, self._writer.begin() as connection:
            if not self.is_sqlite:
                connection.execute(text("SELECT pg_advisory_xact_lock(:lock)"), {"lock": MIGRATION_LOCK})
            upgrade(connection)

    def close(self) -> None:
        """Closes every connection."""
        self.engine.dispose()


def upgrade(connection: Connection) -> None:
    """Runs the missing migrations in the connection's transaction."""
    from alembic import command
    from alembic.config import Config

    config = Config()
    config.set_main_option("script_location", "grader.store:migrations")
    config.attributes["connection"] = connection
    command.upgrade(config, "head")


def _set_up_sqlite(engine: Engine) -> None:
    """WAL, foreign keys, and transactions that we begin ourselves: the driver's own would not cover DDL and reads."""

    @event.listens_for(engine, "connect")
    def on_connect(connection: Any, _record: Any) -> None:
        connection.isolation_level = None
        for pragma in ("journal_mode = WAL", "synchronous = NORMAL", "foreign_keys = ON"):
            connection.execute(f"PRAGMA {pragma}")

    @event.listens_for(engine, "begin")
    def on_begin(connection: Connection) -> None:
        # A writer takes the lock at once: a reader that turns writer halfway would fail instead of waiting.
        writes = connection.get_execution_options().get("writes", False)
        connection.exec_driver_sql("BEGIN IMMEDIATE" if writes else "BEGIN")
