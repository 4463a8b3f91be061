"""Commands whose database is away or whose disk is full: one line that names the database, and no traceback."""

import sqlite3
from contextlib import closing
from pathlib import Path

import pytest
from sqlalchemy import event
from sqlalchemy.engine import Engine

from support.command_line import grader
from support.databases import need_postgresql, own_database
from support.proxies import free_port

COMMANDS = [("token", "list"), ("invite", "ann"), ("deliveries",), ("rotate-secret",), ("prune", "--older-than", "3")]


def say(*arguments: str) -> str:
    """The one line that a refused command says."""
    done = grader(*arguments)
    [line] = done.stderr.splitlines()
    assert done.returncode == 2
    assert not done.stdout
    assert "cret" not in line
    return line


@pytest.mark.parametrize("command", COMMANDS)
def test_a_database_that_is_away_is_named(command: tuple[str, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    port = free_port()
    monkeypatch.setenv("GRADER_DATABASE_URL", f"postgresql://postgres:secret@127.0.0.1:{port}/x")
    line = say(*command)
    assert line.startswith(f"The database 127.0.0.1:{port}/x cannot be used: ")
    assert "Connection refused" in line


@pytest.mark.postgres
def test_an_unknown_database_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    need_postgresql()
    monkeypatch.setenv("GRADER_DATABASE_URL", f"{own_database()}_nowhere")
    assert '_nowhere" does not exist' in say("token", "list")


def test_a_full_disk_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GRADER_DATA", str(tmp_path))
    assert grader("token", "list").returncode == 0

    def limit(connection: sqlite3.Connection, _record: object) -> None:
        connection.execute("PRAGMA max_page_count = 1")  # means: as many as the file has

    with closing(sqlite3.connect(tmp_path / "grader.db")) as connection:
        connection.execute("VACUUM")  # no page of it is free
    event.listen(Engine, "connect", limit)
    try:
        for number in range(1000):
            done = grader("invite", f"{'ann' * 60} {number}")
            if done.returncode:
                break
    finally:
        event.remove(Engine, "connect", limit)
    assert done.returncode == 2
    assert done.stderr.splitlines()[-1].startswith(f"The database {tmp_path}/grader.db cannot be used: ")
    assert "full" in done.stderr


def test_a_backup_that_finds_no_room_says_so_and_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("GRADER_DATA", str(tmp_path / "data"))
    assert grader("token", "list").returncode == 0
    (tmp_path / "copies").mkdir()

    class FullDisk(sqlite3.Connection):
        """A connection that cannot write a copy."""

        def execute(self, *_: object) -> sqlite3.Cursor:
            raise sqlite3.OperationalError("database or disk is full")

    connect = sqlite3.connect
    monkeypatch.setattr("grader.store.upkeep.backup.sqlite3.connect", lambda path: connect(path, factory=FullDisk))
    line = say("backup", str(tmp_path / "copies/one.db"))
    assert str(tmp_path / "data/grader.db") in line
    assert line.endswith("database or disk is full")
    assert list((tmp_path / "copies").iterdir()) == []
