"""Statements that wait for the next one: fewer round trips to PostgreSQL, and otherwise as if sent at once."""

import asyncio
from collections.abc import Callable, Iterator, Sequence
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any

import pytest
from sqlalchemy import text
from sqlalchemy.exc import DataError, IntegrityError, InternalError, OperationalError
from sqlalchemy.orm import Session

from databases import BACKENDS, open_database
from grader.content import Contents
from grader.courses.handing_in import Answer, Receipt, hand_in
from grader.courses.tokens import create_token
from grader.identity import Identity, authenticate
from grader.store.database import Database
from grader.store.later import LATER
from grader.store.writer import Writer
from sites import write_content

HANDING_IN = 2
"""Round trips of any number of answers: locks and what is stored; new rows and the commit."""


@pytest.fixture(params=BACKENDS)
def database(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Database]:
    with open_database(request.param, tmp_path) as database:
        with database.write() as session:
            session.execute(text("CREATE TABLE notes (id int PRIMARY KEY, said text)"))
        yield database


def note(session: Session, number: int) -> None:
    session.connection().exec_driver_sql(f"INSERT INTO notes (id) VALUES ({number})", execution_options=LATER)


def notes(database: Database) -> Sequence[int]:
    with database.read() as session:
        return session.scalars(text("SELECT id FROM notes ORDER BY id")).all()


def round_trips(database: Database, work: Callable[[Session], None]) -> int:
    """How often the client waits for PostgreSQL in a transaction with this work, as libpq traces it."""
    with TemporaryFile() as trace, database.write() as session:
        pooled: Any = session.connection().connection.driver_connection
        pooled.pgconn.trace(trace.fileno())
        work(session)
        session.commit()
        pooled.pgconn.untrace()
        trace.seek(0)
        return trace.read().count(b"ReadyForQuery")


def test_a_query_sees_what_was_kept_back_before(database: Database) -> None:
    with database.write() as session:
        note(session, 1)
        note(session, 2)
        assert session.scalar(text("SELECT count(*) FROM notes")) == 2
        session.execute(text("INSERT INTO notes (id) VALUES (:id)"), [{"id": 3}, {"id": 4}])
    assert notes(database) == [1, 2, 3, 4]


def test_many_rows_at_once_come_after_what_was_kept_back(database: Database) -> None:
    with database.write() as session:
        note(session, 1)
        session.connection().exec_driver_sql(
            f"INSERT INTO notes (id) SELECT max(id) + {'?' if database.is_sqlite else '%s'} FROM notes", [(1,), (2,)]
        )
    assert notes(database) == [1, 2, 4]


def test_rows_that_are_streamed_come_after_what_was_kept_back(database: Database) -> None:
    with database.write() as session:
        note(session, 1)
        note(session, 2)
        found = session.scalars(text("SELECT id FROM notes ORDER BY id"), execution_options={"yield_per": 1})
        assert list(found) == [1, 2]
    assert notes(database) == [1, 2]


def test_what_was_kept_back_ends_with_its_transaction(database: Database) -> None:
    def fails() -> None:
        with database.write() as session:
            note(session, 1)
            raise KeyError

    with pytest.raises(KeyError):
        fails()
    with database.write() as session:
        note(session, 2)
    assert notes(database) == [2]


def test_a_refused_row_undoes_the_transaction_at_the_latest_with_its_commit(database: Database) -> None:
    def twice() -> None:
        with database.write() as session:
            session.execute(text("INSERT INTO notes (id) VALUES (1)"))
            note(session, 2)
            note(session, 1)
            note(session, 3)

    with pytest.raises(IntegrityError):
        twice()
    assert notes(database) == []
    with database.write() as session:
        note(session, 1)
    assert notes(database) == [1]


def test_an_error_kept_back_is_raised_with_the_next_statement(database: Database) -> None:
    with pytest.raises((IntegrityError, DataError)), database.write() as session:
        note(session, 1)
        note(session, 1)
        session.execute(text("SELECT 1"))
    assert notes(database) == []


@pytest.mark.parametrize("database", ["postgresql"], indirect=True)
def test_statements_stay_prepared_when_a_reader_ends(database: Database) -> None:
    """Else every statement is parsed and planned anew."""
    for _ in range(10):
        notes(database)
    with database.read() as session:
        prepared = session.scalars(text("SELECT statement FROM pg_prepared_statements")).all()
    assert "SELECT id FROM notes ORDER BY id" in prepared


def test_a_reader_stores_nothing(database: Database) -> None:
    refused = nullcontext() if database.is_sqlite else pytest.raises(InternalError)
    with refused, database.read() as session:
        session.execute(text("INSERT INTO notes (id) VALUES (1)"))
    assert notes(database) == []


@pytest.mark.parametrize("database", ["postgresql"], indirect=True)
def test_a_connection_lost_at_the_end_of_a_reader_is_replaced(database: Database) -> None:
    with pytest.raises(OperationalError), database.read() as session:
        lost = session.scalar(text("SELECT pg_backend_pid()"))
        with database.write() as other:
            other.execute(text("SELECT pg_terminate_backend(:lost, 5000)"), {"lost": lost})
    assert notes(database) == []


def put_together(database: Database, items: list[int], keep: Callable[[Session, Sequence[int]], None]) -> list[Any]:
    """What a writer says of items that wait for one transaction: None, or the error."""

    async def put() -> list[Any]:
        writer = Writer(database, keep)
        waiting = [asyncio.create_task(writer.put(item, lambda: None)) for item in items]
        await asyncio.sleep(0)
        writer.start()
        said = await asyncio.gather(*waiting, return_exceptions=True)
        writer.close()
        return said

    return asyncio.run(put())


def test_a_row_that_is_refused_with_the_commit_fails_alone(database: Database) -> None:
    def keep(session: Session, items: Sequence[int]) -> None:
        for item in items:
            note(session, item)

    said = put_together(database, [1, 2, 1, 3], keep)
    assert [type(one) for one in said] == [type(None), type(None), IntegrityError, type(None)]
    assert notes(database) == [1, 2, 3]


@pytest.mark.parametrize("database", ["postgresql"], indirect=True)
def test_after_a_connection_lost_with_the_commit_nothing_is_tried_again(database: Database) -> None:
    tried = []

    def keep(session: Session, items: Sequence[int]) -> None:
        tried.append(list(items))
        end = "SELECT pg_terminate_backend(pg_backend_pid())"
        session.connection().exec_driver_sql(end, execution_options=LATER)

    said = put_together(database, [1, 2], keep)
    assert [type(one) for one in said] == [OperationalError, OperationalError]
    assert tried == [[1, 2]]
    with database.write() as session:
        note(session, 1)
    assert notes(database) == [1]


def answers_on(database: Database, folder: Path) -> list[Answer]:
    """A right and a wrong choice of each of three learners."""
    pipeline = Contents(write_content(folder), {}, database).of("default").pipeline

    def answer(who: Identity, option: int) -> Answer:
        read = pipeline.read("small", "q1", option)
        return Answer(who, pipeline.library, read, pipeline.judge(read), f"{who.id} {option}")

    with database.write() as session:
        tokens = [create_token(session, name, "student", None) for name in ("ann", "bob", "cat")]
    return [answer(authenticate(database, f"Bearer {token}", {}), option) for token in tokens for option in (1, 2)]


@pytest.mark.parametrize("database", ["postgresql"], indirect=True)
def test_answers_take_two_round_trips_however_many_they_are(database: Database, tmp_path: Path) -> None:
    taken = answers_on(database, tmp_path)
    counts = [round_trips(database, partial(hand_in, database, waiting=batch)) for batch in (taken[:1], taken[1:])]
    assert counts == [HANDING_IN, HANDING_IN]
    assert all(isinstance(one.outcome, Receipt) for one in taken)


@pytest.mark.parametrize("database", ["postgresql"], indirect=True)
def test_what_is_asked_of_answers_is_planned_once(database: Database, tmp_path: Path) -> None:
    """A prepared statement that PostgreSQL plans for its values is planned with every batch."""
    taken = answers_on(database, tmp_path)
    for _ in range(10):
        with database.write() as session:
            hand_in(database, session, [replace(one, key=None) for one in taken])
    planned = text(
        "SELECT generic_plans, custom_plans FROM pg_prepared_statements WHERE statement LIKE 'SELECT results%'"
    )
    with database.read() as session:
        ((kept, anew),) = session.execute(planned).all()
    assert kept > 0
    assert anew == 0
