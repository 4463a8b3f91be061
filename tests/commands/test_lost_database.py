"""Commands whose database is away or whose disk is full: one line that names the database, and no traceback."""

import re
import secrets
import sqlite3
import sys
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace

import psycopg
import pytest
from sqlalchemy import event
from sqlalchemy.engine import Engine, make_url
from sqlalchemy.exc import OperationalError

from grader.errors import NotReady
from grader.metrics import locked
from grader.service.opening import open_database as open_service_database
from grader.settings import Settings
from grader.store.engine.database import FULL, Database
from grader.store.engine.unusable import find_cure
from support.command_line import Terminal, grader
from support.databases import database_url, need_postgresql, own_database
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
    line = say("token", "list")
    assert '_nowhere" does not exist' in line
    assert re.search(r"administrator: createdb --owner=\w+ \w+_nowhere$", line)


@pytest.mark.parametrize(
    ("why", "cure"),
    [
        ('FATAL: role "ada" does not exist', "Make the role, {}: createuser --pwprompt ada"),
        ('FATAL: database "x y" does not exist', "Make the database, {}: createdb --owner=ada 'x y'"),
        (
            'password authentication failed for user "ada"',
            "Mend the password, or make the role, {}: createuser --pwprompt ada",
        ),
        ("FATAL: Rolle »ada« existiert nicht", "If it is not there, {}: createuser --pwprompt ada"),
        ("FATAL: la base de données « x y » n'existe pas", "If it is not there, {}: createdb --owner=ada 'x y'"),
        ('FATAL: no pg_hba.conf entry for user "ada", database "x y"', None),
        ("Connection refused", None),
    ],
)
def test_a_role_or_database_that_is_not_there_has_a_cure(why: str, cure: str | None) -> None:
    told = find_cure(make_url("postgresql://ada:secret@host/x y"), why)
    assert told == (cure and cure.format("as PostgreSQL's administrator"))


@pytest.mark.postgres
def test_a_role_that_may_not_make_tables_is_named_with_the_cure(monkeypatch: pytest.MonkeyPatch) -> None:
    need_postgresql()
    name = f"grader_test_{secrets.token_hex(6)}"
    url = make_url(own_database()).set(username=f"{name}_r", password="secret", database=name)
    with psycopg.connect(own_database(), autocommit=True) as connection:
        connection.execute(f"CREATE ROLE {name}_r LOGIN PASSWORD 'secret'")
        connection.execute(f"CREATE DATABASE {name}")
        try:
            monkeypatch.setenv("GRADER_DATABASE_URL", url.render_as_string(hide_password=False))
            with psycopg.connect(make_url(own_database()).set(database=name).render_as_string(False)) as inside:
                inside.execute("REVOKE CREATE ON SCHEMA public FROM PUBLIC")  # as PostgreSQL 15 has it
            cure = f"make it the owner (`ALTER DATABASE {name} OWNER TO {name}_r`)."
            for command in (("token", "list"), ("worker",)):
                done = grader(*command)
                assert done.returncode == 2
                assert done.stderr.splitlines()[-1] == f"The role {name}_r may not make tables in {name}: {cure}"
            connection.execute(f"ALTER DATABASE {name} OWNER TO {name}_r")
            with psycopg.connect(make_url(own_database()).set(database=name).render_as_string(False)) as inside:
                inside.execute(f"GRANT CREATE ON SCHEMA public TO {name}_r")  # the owner's by itself since 15
            assert grader("token", "list").returncode == 0
        finally:
            connection.execute(f"DROP DATABASE {name} WITH (FORCE)")
            connection.execute(f"DROP ROLE {name}_r")


@pytest.mark.postgres
def test_an_option_that_cannot_be_read_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GRADER_DATABASE_URL", "postgresql://ada:secret@127.0.0.1/x?connect_timeout=soon")
    assert say("token", "list").endswith("/x cannot be used: bad value for connect_timeout: 'soon'")


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
    monkeypatch.setattr("shutil.disk_usage", lambda _: SimpleNamespace(free=1 << 20))
    monkeypatch.setattr(Database, "migrate", full_commit)
    line = say("token", "list")
    assert line == f"{FULL} Make room for {tmp_path}/grader.db."


def full_commit(_database: Database) -> None:
    """Fails as SQLite does where the last page of a transaction finds no room."""
    error = sqlite3.OperationalError("disk I/O error")
    error.sqlite_errorcode = sqlite3.SQLITE_IOERR
    raise OperationalError(None, None, error)


def test_what_is_no_database_is_named_with_the_cure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GRADER_DATA", str(tmp_path))
    (tmp_path / "grader.db").write_text("hello")
    line = say("token", "list")
    assert line.startswith(f"{tmp_path}/grader.db is damaged, or no database: ")
    assert line.endswith("Put a backup in its place, as docs/operating.md says.")


def test_files_that_are_not_there_are_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GRADER_DATA", str(tmp_path))
    assert grader("token", "list").returncode == 0
    assert say("backup", "/nowhere/x.db") == "There is no folder /nowhere."
    assert say("roster", "import", "/nowhere.csv") == "/nowhere.csv: No such file or directory"


def test_tables_are_not_moved_beside_a_server_and_never_without_a_word(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("GRADER_DATA", str(tmp_path))
    newest = grader("migrate").stdout.strip()
    assert grader("migrate", "0006").stdout == "0006\n"
    assert f"The tables were brought from revision 0006 to {newest}" in grader("token", "list").stderr
    with locked(tmp_path):  # as a server does
        assert say("migrate", "0006") == f"A server works on {tmp_path}: stop it first."
        assert grader("token", "list").returncode == 0


@pytest.mark.postgres
def test_tables_are_not_brought_back_under_a_server_on_postgresql(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with database_url("postgresql", tmp_path) as url:
        monkeypatch.setenv("GRADER_DATABASE_URL", url)
        with closing(open_service_database(Settings(database_url=url))) as served:
            refused = grader("migrate", "0006")
            assert (refused.returncode, refused.stdout) == (2, "")
            assert "Servers or workers work on this database" in refused.stderr and "stop them first" in refused.stderr
            served.check()
            newest = grader("migrate").stdout.strip()
            done = grader("migrate", "0015", "--yes")
            assert done.stdout == "0015\n"
            assert f"Going back from revision {newest} to 0015 loses for good what only later" in done.stderr
            with pytest.raises(NotReady, match=f"are of revision 0015, this version needs {newest}"):
                served.check()
        assert grader("migrate", "0006").stdout == "0006\n"


def test_who_brings_tables_back_in_a_terminal_is_asked_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GRADER_DATA", str(tmp_path))
    newest = grader("migrate").stdout.strip()
    for typed, options, code, revision in (
        ("n\n", (), 1, newest),
        ("y\n", (), 0, "0015"),
        ("", ("--yes",), 0, "0006"),
    ):
        monkeypatch.setattr(sys, "stdin", Terminal(typed))
        assert grader("migrate", "0006" if options else "0015", *options).returncode == code
        with closing(Database(f"sqlite:///{tmp_path}/grader.db")) as database:
            assert database.revision == revision


def test_a_new_course_is_told_and_the_one_that_was_meant(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GRADER_DATA", str(tmp_path))
    assert "is a new course" not in grader("invite", "ann").stderr
    assert "robots is a new course." in grader("invite", "--course", "robots", "ann").stderr
    assert "is a new course" not in grader("invite", "--course", "robots", "bob").stderr
    refused = grader("token", "list", "--course", "robotz")
    assert (refused.returncode, "There is no course 'robotz'; the courses are default, robots." in refused.stderr) == (
        2, True
    )  # fmt: skip
    assert "robotz is a new course: did you mean robots?" in grader("invite", "--course", "robotz", "ann").stderr


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
