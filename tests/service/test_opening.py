"""How a service begins: it waits for a database that is not there yet, and refuses one without sessions."""

import secrets
import socket
import threading
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import psycopg
import pytest
from sqlalchemy.engine import make_url

from grader.errors import Unprocessable
from grader.queue.owners import build_owner, count_workers
from grader.service.opening import open_database
from grader.settings import Settings
from grader.store.engine.database import Database
from grader.store.engine.signals import announce
from support.clusters import pgbouncer
from support.command_line import grader
from support.databases import database_url, need_postgresql, own_database
from support.outages import cable_to
from support.processes import descendants_running
from support.queue_kills import START_S, process_of, settings_on, wait_for

pytestmark = [pytest.mark.postgres, pytest.mark.slow]


@pytest.mark.process
@pytest.mark.jail
def test_a_worker_waits_for_its_database_and_says_so(tmp_path: Path) -> None:
    log = tmp_path / "log"
    with database_url("postgresql", tmp_path) as url, cable_to(url) as (cable, through):
        cable.cut()
        log.touch()
        with process_of("worker", settings_on(through, tmp_path), log=log) as worker:
            wait_for(lambda: "waiting for the database" in log.read_text() or worker.poll() is not None)
            assert worker.poll() is None
            cable.mend()
            with closing(Database(url)) as database:

                def count() -> int:
                    with database.read() as session:
                        return count_workers(session)

                wait_for(lambda: count() == 1)
    [line] = [line for line in log.read_text().splitlines() if "waiting" in line]
    assert f"127.0.0.1:{cable.port}" in line
    assert "Connection refused" in line


@pytest.mark.process
@pytest.mark.jail
@pytest.mark.parametrize("command", ["serve", "worker"])
def test_a_process_that_waits_for_its_database_ends_on_sigterm(command: str, tmp_path: Path) -> None:
    log = tmp_path / "log"
    with database_url("postgresql", tmp_path) as url, cable_to(url) as (cable, through):
        cable.cut()
        log.touch()
        with process_of(command, settings_on(through, tmp_path), log=log) as waiting:
            wait_for(lambda: "waiting for the database" in log.read_text() or waiting.poll() is not None)
            waiting.terminate()
            waiting.wait(START_S)
    assert "Traceback" not in log.read_text()


@pytest.mark.process
@pytest.mark.jail
def test_a_worker_takes_zero_as_the_default(tmp_path: Path) -> None:
    """A server that grades nothing has it in the file that the unit of its workers reads too."""
    log = tmp_path / "log"
    log.touch()
    with (
        database_url("postgresql", tmp_path) as url,
        process_of("worker", settings_on(url, tmp_path, workers=0), log=log) as worker,
        closing(Database(url)) as database,
    ):
        database.migrate()

        def has_started() -> bool:
            with database.read() as session:
                return count_workers(session) == 1 or worker.poll() is not None

        wait_for(has_started)
        assert worker.poll() is None, log.read_text()
        assert len(set(descendants_running(worker.pid, "grader.grading.process_main"))) >= 1


def test_a_worker_without_a_port_for_its_metrics_names_the_setting(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with database_url("postgresql", tmp_path) as url, socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        monkeypatch.setenv("GRADER_DATABASE_URL", url)
        monkeypatch.setenv("GRADER_METRICS_PORT", str(port))
        done = grader("worker")
    assert done.returncode == 2
    [line] = done.stderr.splitlines()
    assert line.startswith(f"GRADER_METRICS_PORT: port {port} of 127.0.0.1 cannot be opened (Address already in use)")


@pytest.fixture
def whole_database() -> Iterator[str]:
    """The URL of an empty database of its own: PgBouncer takes no search path."""
    need_postgresql()
    name = f"grader_test_{secrets.token_hex(6)}"
    with psycopg.connect(own_database(), autocommit=True) as connection:
        connection.execute(f"CREATE DATABASE {name}")
        try:
            yield make_url(own_database()).set(database=name).render_as_string(hide_password=False)
        finally:
            connection.execute(f"DROP DATABASE {name} WITH (FORCE)")


def test_pgbouncer_in_transaction_mode_is_refused_with_the_cure(whole_database: str) -> None:
    with pgbouncer(whole_database, "transaction") as url:
        for _ in range(3):  # the pool of PgBouncer is filled differently each time
            with pytest.raises(Unprocessable, match="to PostgreSQL itself, or to PgBouncer in session mode"):
                open_database(Settings(database_url=url))


def test_pgbouncer_in_session_mode_works_with_locks_and_signals(whole_database: str) -> None:
    with pgbouncer(whole_database, "session") as url, closing(open_database(Settings(database_url=url))) as database:
        heard, owner = threading.Event(), build_owner(database)
        owner.keep()
        with database.signals.listening("events", heard.set, "one"):
            assert heard.wait(START_S)  # the listening has begun
            heard.clear()
            with database.write() as session:
                announce(session, "events", "one")
            assert heard.wait(START_S)
        with database.read() as session:
            assert count_workers(session) == 1
        owner.close()
