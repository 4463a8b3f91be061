"""What belongs to the installation as a whole."""

import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from grader.store.engine.database import Database
from grader.store.upkeep.installation import find_origin, note_origin
from support.databases import BACKENDS, open_database

ORIGINS = ("https://one.example", "https://two.example")


@pytest.fixture(params=BACKENDS)
def database(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Database]:
    with open_database(request.param, tmp_path) as database:
        yield database


def test_the_origin_is_that_of_the_server_that_started_last(database: Database) -> None:
    for origin in ORIGINS:
        with database.write() as session:
            note_origin(session, origin)
        with database.read() as session:
            assert find_origin(session) == origin


def test_two_servers_start_at_once_on_an_empty_database(tmp_path: Path) -> None:
    """On SQLite one of them waits before it reads anything."""
    with open_database("postgresql", tmp_path) as database:
        faults: list[Exception] = []

        def start(origin: str) -> None:
            try:
                with database.write() as session:
                    assert find_origin(session) is None
                    both.wait(30)
                    note_origin(session, origin)
            except Exception as error:
                faults.append(error)

        both = threading.Barrier(2)
        threads = [threading.Thread(target=start, args=(origin,)) for origin in ORIGINS]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(30)
        assert faults == []
        with database.read() as session:
            assert find_origin(session) in ORIGINS
