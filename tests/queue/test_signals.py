"""Signals reach listeners in every process, also after a lost connection."""

import threading

from sqlalchemy import text

from grader.store.engine.database import Database
from grader.store.engine.signals import announce

WAIT_S = 20.0


def test_a_signal_comes_after_the_commit_and_to_its_own_listeners_only(database: Database) -> None:
    heard, other = threading.Event(), threading.Event()
    with database.signals.listening("events", heard.set, "one"):
        wait_for_listening(database, heard)
        with database.signals.listening("events", other.set, "two"), database.write() as session:
            announce(session, "events", "one")
            assert not heard.wait(0.1)
        assert heard.wait(WAIT_S)
        assert not other.is_set()


def test_a_failed_transaction_is_not_announced(database: Database) -> None:
    heard = threading.Event()
    with database.signals.listening("events", heard.set, "one"):
        wait_for_listening(database, heard)
        try:
            with database.write() as session:
                announce(session, "events", "one")
                raise ZeroDivisionError
        except ZeroDivisionError:
            pass
        assert not heard.wait(0.2)


def test_after_a_lost_connection_every_listener_is_called(database: Database) -> None:
    if database.is_sqlite:
        return
    heard = threading.Event()
    with database.signals.listening("events", heard.set, "one"):
        wait_for_listening(database, heard)
        with database.engine.begin() as connection:
            connection.execute(
                text("SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE application_name = :name"),
                {"name": database.signals.name},
            )
        assert heard.wait(WAIT_S)


def wait_for_listening(database: Database, heard: threading.Event) -> None:
    """Waits until the listening has begun, which calls every listener of that moment."""
    if not database.is_sqlite:
        assert heard.wait(WAIT_S)
        heard.clear()
