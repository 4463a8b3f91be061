"""Transactions for reading and for writing, on both databases."""

from collections.abc import Iterator, Sequence
from contextlib import nullcontext
from pathlib import Path

import pytest
from sqlalchemy import select, text
from sqlalchemy.exc import IntegrityError, InternalError, OperationalError
from sqlalchemy.orm import Session

from grader.store.engine.bulk import insert_rows, keys_table, read_by_keys
from grader.store.engine.database import Database
from grader.store.tables import ExtensionRow, Member, now
from support.databases import BACKENDS, open_database


@pytest.fixture(params=BACKENDS)
def database(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Database]:
    with open_database(request.param, tmp_path) as database:
        with database.write() as session:
            session.execute(text("CREATE TABLE notes (id int PRIMARY KEY)"))
        yield database


def note(session: Session, number: int) -> None:
    session.execute(text("INSERT INTO notes (id) VALUES (:id)"), {"id": number})


def notes(database: Database) -> Sequence[int]:
    with database.read() as session:
        return session.scalars(text("SELECT id FROM notes ORDER BY id")).all()


def test_a_refused_row_undoes_the_transaction(database: Database) -> None:
    def twice() -> None:
        with database.write() as session:
            note(session, 1)
            note(session, 1)

    with pytest.raises(IntegrityError):
        twice()
    assert notes(database) == []
    with database.write() as session:
        note(session, 1)
    assert notes(database) == [1]


def test_a_reader_stores_nothing(database: Database) -> None:
    refused = nullcontext() if database.is_sqlite else pytest.raises(InternalError)
    with refused, database.read() as session:
        note(session, 1)
    assert notes(database) == []


def test_a_reader_that_changes_objects_stores_nothing(database: Database) -> None:
    with database.write() as session:
        session.add(Member(id="m1", course="default", name="ann", role="student"))
    with database.read() as session:
        member = session.get_one(Member, "m1")
        member.name = "bob"
    assert member.name == "bob"
    with database.read() as session:
        assert session.get_one(Member, "m1").name == "ann"


def test_objects_of_a_reader_can_be_read_after_its_end(database: Database) -> None:
    with database.write() as session:
        session.add(Member(id="m1", course="default", name="ann", role="student"))
    with database.read() as session:
        member = session.get_one(Member, "m1")
    assert member.name == "ann"


def test_a_reader_streams_rows(database: Database) -> None:
    with database.write() as session:
        note(session, 1)
        note(session, 2)
    with database.read() as session:
        rows = session.scalars(text("SELECT id FROM notes ORDER BY id"), execution_options={"yield_per": 1})
        assert list(rows) == [1, 2]


@pytest.mark.parametrize("database", ["postgresql"], indirect=True)
def test_statements_stay_prepared_when_a_reader_ends(database: Database) -> None:
    """Else every statement is parsed and planned anew."""
    for _ in range(10):
        notes(database)
    with database.read() as session:
        prepared = session.scalars(text("SELECT statement FROM pg_prepared_statements")).all()
    assert "SELECT id FROM notes ORDER BY id" in prepared


@pytest.mark.parametrize("database", ["postgresql"], indirect=True)
def test_a_connection_lost_at_the_end_of_a_reader_is_replaced(database: Database) -> None:
    with pytest.raises(OperationalError), database.read() as session:
        lost = session.scalar(text("SELECT pg_backend_pid()"))
        with database.write() as other:
            other.execute(text("SELECT pg_terminate_backend(:lost, 5000)"), {"lost": lost})
    assert notes(database) == []


@pytest.mark.parametrize("database", ["postgresql"], indirect=True)
def test_a_connection_lost_in_a_writer_is_replaced(database: Database) -> None:
    with pytest.raises(OperationalError), database.write() as session:
        note(session, 1)
        session.execute(text("SELECT pg_terminate_backend(pg_backend_pid())"))
    assert notes(database) == []


def an_extension(learner: str, quiz: str) -> dict[str, object]:
    return {"course": "a", "learner": learner, "quiz": quiz, "attempts": 1, "granted_by": "t", "created_at": now()}


def test_rows_are_found_by_keys_of_several_columns(database: Database) -> None:
    hostile = "o'\"\\ \u00e9\u2028{}"
    rows = [an_extension(learner, quiz) for learner in ("ann", "bob", hostile) for quiz in ("one", "two")]
    keys = [("ann", "one"), ("bob", "two"), (hostile, "one"), ("cat", "one"), ("one", "ann")]
    with database.write() as session:
        insert_rows(session, (ExtensionRow, rows), (ExtensionRow, []))
        wanted = keys_table(database.backend, ("learner", "quiz"))
        same = (ExtensionRow.learner == wanted.c.learner) & (ExtensionRow.quiz == wanted.c.quiz)
        query = select(ExtensionRow.learner, ExtensionRow.quiz).join(wanted, same)
        named = [{"learner": learner, "quiz": quiz} for learner, quiz in keys]
        assert sorted(read_by_keys(session, query, named)) == sorted(keys[:3])
        assert not read_by_keys(session, query, [])
