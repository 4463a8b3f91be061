"""News of committed changes, for listeners in this process and, on PostgreSQL, in all others (LISTEN and NOTIFY). A
signal says that something may have changed, not what: its listener reads the database. After a lost connection every
listener is called, since signals may have been missed."""

import json
import secrets
import threading
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import structlog
from sqlalchemy import Engine, text
from sqlalchemy.exc import DBAPIError
from sqlalchemy.orm import Session

CHANNEL = "grader"
PENDING = "signals"
CLOSE_S = 0.5
"""How soon the listening thread notices that it is closed [s]."""
RETRY_S = 1.0
"""Pause before the next try to reach a lost database [s]."""

NOTIFY = text(
    f"SELECT pg_notify('{CHANNEL}', note) FROM json_array_elements_text(CAST(:notes AS json)) AS note"  # noqa: S608
)

Key = tuple[str, str]
Listener = Callable[[], None]

log = structlog.get_logger()


def announce(session: Session, topic: str, subject: str = "") -> None:
    """Calls the listeners of this topic and subject once the session's transaction, a `Database.write`, commits."""
    session.info.setdefault(PENDING, {})[topic, subject] = None


class Signals:
    """The listeners of one database. They are called in another's thread, and must return at once."""

    def __init__(self, engine: Engine, is_sqlite: bool) -> None:
        self._engine, self._is_sqlite = engine, is_sqlite
        self.name = f"grader-signals-{secrets.token_hex(4)}"
        """The name of the listening session, as PostgreSQL lists it."""
        self._listeners: dict[Key, list[Listener]] = defaultdict(list)
        self._lock = threading.Lock()
        self._closed = threading.Event()
        self._thread: threading.Thread | None = None

    @contextmanager
    def listening(self, topic: str, listener: Listener, subject: str = "") -> Iterator[None]:
        """Calls `listener` after every change of this topic and subject."""
        with self._lock:
            self._listeners[topic, subject].append(listener)
            if not self._is_sqlite and self._thread is None and not self._closed.is_set():
                self._thread = threading.Thread(target=self._follow, name="signals", daemon=True)
                self._thread.start()
        try:
            yield
        finally:
            with self._lock:
                self._listeners[topic, subject].remove(listener)
                if not self._listeners[topic, subject]:
                    del self._listeners[topic, subject]

    def before_commit(self, session: Session) -> None:
        """Sends the session's signals with its transaction, to all processes."""
        if not self._is_sqlite:
            notes = json.dumps([f"{topic} {subject}" for topic, subject in session.info[PENDING]])
            session.connection().execute(NOTIFY, {"notes": notes})

    def after_commit(self, session: Session) -> None:
        """Calls the listeners in this process, if no server does it."""
        if self._is_sqlite:
            for key in session.info[PENDING]:
                self._call(key)

    def close(self) -> None:
        """Ends the listening."""
        self._closed.set()
        if self._thread is not None:
            self._thread.join()

    def _call(self, key: Key) -> None:
        with self._lock:
            listeners = list(self._listeners.get(key, ()))
        for listener in listeners:
            try:
                listener()
            except Exception:
                log.exception("a listener failed", topic=key[0])

    def _follow(self) -> None:
        import psycopg  # not needed on SQLite

        while not self._closed.is_set():
            try:
                self._listen()
            except (psycopg.Error, DBAPIError) as error:
                log.warning("signals are lost until the database is back", error=type(error).__name__)
                self._closed.wait(RETRY_S)

    def _listen(self) -> None:
        import psycopg

        pooled = self._engine.raw_connection()
        try:
            connection = pooled.driver_connection
            assert isinstance(connection, psycopg.Connection)
            connection.autocommit = True
            connection.execute("SELECT set_config('application_name', %s, false)", (self.name,))
            connection.execute(f"LISTEN {CHANNEL}")
            with self._lock:
                keys = list(self._listeners)
            for key in keys:
                self._call(key)
            while not self._closed.is_set():
                for note in connection.notifies(timeout=CLOSE_S):
                    topic, _, subject = note.payload.partition(" ")
                    self._call((topic, subject))
        finally:
            pooled.invalidate()
