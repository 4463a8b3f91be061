"""Queries past SQLAlchemy: the same rows, and the same errors."""

from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

import pytest
from sqlalchemy import bindparam, func, literal, select, text
from sqlalchemy.exc import DataError, IntegrityError, OperationalError, ProgrammingError

from databases import BACKENDS, open_database
from grader.store.database import Database
from grader.store.direct import DirectQuery
from grader.store.driver import driver_of
from grader.store.rows import insert_rows
from grader.store.tables import Credential, Member, Submission, now

MEMBER = {"id": "m1", "course": "default", "name": "ann", "role": "student", "created_at": now()}
EXPIRES = datetime(2031, 5, 6, 7, 8, 9, 123456, tzinfo=UTC)


@pytest.fixture(params=BACKENDS)
def database(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Database]:
    with open_database(request.param, tmp_path) as database:
        with database.write() as session:
            insert_rows(session, Member, [MEMBER])
            session.add(
                Credential(
                    id="c1", kind="token", secret_hash="", member="m1", user="ann", role="student", course="default",
                    expires_at=EXPIRES,
                )
            )  # fmt: skip
        yield database


def test_rows_are_those_of_sqlalchemy(database: Database) -> None:
    columns = (
        Credential.id,
        Credential.expires_at,
        Credential.revoked_at,
        Credential.revoked_at.is_(None).label("holds"),
        (func.length(Credential.user) + literal(1)).label("length"),
    )
    query = select(*columns).where(Credential.member == bindparam("of"), Credential.kind == "token")
    with database.read() as session:
        for _ in range(2):  # compiled, and then recalled
            (row,) = DirectQuery(query).rows(session.connection(), of="m1")
            assert tuple(row) == tuple(session.execute(query, {"of": "m1"}).one())
        assert row._asdict() == {"id": "c1", "expires_at": EXPIRES, "revoked_at": None, "holds": True, "length": 4}
        assert not DirectQuery(query).rows(session.connection(), of="m2")


def test_a_query_sees_the_rows_that_its_transaction_has_inserted(database: Database) -> None:
    query = DirectQuery(select(func.count().label("count")).select_from(Member))
    with database.write() as session:
        insert_rows(session, Member, [MEMBER | {"id": "m2"}])
        assert query.rows(session.connection())[0].count == 2


def test_errors_are_those_of_sqlalchemy_and_undo_the_transaction(database: Database) -> None:
    def twice() -> None:
        with database.write() as session:
            insert_rows(session, Member, [MEMBER | {"id": "m2"}])
            insert_rows(session, Member, [MEMBER])

    with pytest.raises(IntegrityError) as caught:
        twice()
    assert "ann" not in str(caught.value)
    query = DirectQuery(select(func.count().label("count")).select_from(Member))
    with database.read() as session:
        assert query.rows(session.connection())[0].count == 1
        session.rollback()
        session.execute(text("SELECT 1"))
    broken = DirectQuery(select(Submission.id).where(text("nothing = 1")))
    with pytest.raises((OperationalError, ProgrammingError)), database.read() as session:
        broken.rows(session.connection())


@pytest.mark.parametrize("database", ["postgresql"], indirect=True)
def test_a_connection_that_is_lost_in_a_query_is_given_up(database: Database) -> None:
    end = DirectQuery(select(func.pg_terminate_backend(func.pg_backend_pid()).label("ended")))
    count = DirectQuery(select(func.count().label("count")).select_from(Member))
    with pytest.raises(OperationalError) as caught, database.write() as session:
        lost = driver_of(session.connection())
        end.rows(session.connection())
    assert caught.value.connection_invalidated
    with database.write() as session:
        assert driver_of(session.connection()) is not lost
        assert count.rows(session.connection())[0].count == 1


@pytest.mark.parametrize("database", ["postgresql"], indirect=True)
def test_a_value_that_the_database_refuses_is_an_error_of_data(database: Database) -> None:
    with pytest.raises(DataError), database.read() as session:
        DirectQuery(select((literal(1) / bindparam("by", 1)).label("share"))).rows(session.connection(), by=0)
