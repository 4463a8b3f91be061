"""Rows that were written before learners had ids keep their learner."""

from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import Connection, select, text
from sqlalchemy.exc import IntegrityError

from grader.store.engine.database import Database
from grader.store.tables import Credential, Member
from support.databases import BACKENDS, database_url

ANONYMOUS = "learner-0a1b2c"

SUBMISSION = """INSERT INTO submissions (id, course, "user", quiz, question, answer, content_digest, status, attempt,
uses_attempt, revision, version, created_at)
VALUES (:id, 'c', :user, 'z', 'q', '1', 'd', 'graded', 1, true, 1, 1, CURRENT_TIMESTAMP)"""
EVENT = "INSERT INTO events VALUES (:id, 1, 'graded', CURRENT_TIMESTAMP)"
CREDENTIAL = """INSERT INTO credentials (id, kind, secret_hash, "user", role, course, created_at)
VALUES (:user, :kind, 'h', :user, 'student', 'c', CURRENT_TIMESTAMP)"""
KEY = "INSERT INTO idempotency_keys VALUES ('c', :user, 'k', 'd', :id, 201, CURRENT_TIMESTAMP)"


@pytest.mark.parametrize("backend", BACKENDS)
def test_rows_from_before_members_keep_their_learner(backend: str, tmp_path: Path) -> None:
    with database_url(backend, tmp_path, empty=True) as url:
        database = Database(url)
        database.migrate("0003")
        with database.engine.connect() as connection, connection.begin():
            fill_as_before(connection)
        database.migrate()
        check_owners(database)
        with pytest.raises(IntegrityError), database.write() as session:
            session.execute(text(EVENT), {"id": "none"})  # foreign keys are on again
        database.close()


def fill_as_before(connection: Connection) -> None:
    """Two learners with two submissions each: one with a token, one whose name the service made up."""
    for user, kind in (("ada", "grt"), (ANONYMOUS, "grs")):
        for number in (1, 2):
            row: dict[str, Any] = {"id": f"{user}{number}", "user": user, "kind": kind}
            connection.execute(text(SUBMISSION), row)
            connection.execute(text(EVENT), row)
        connection.execute(text(CREDENTIAL), row)
        connection.execute(text(KEY), row)


def check_owners(database: Database) -> None:
    with database.read() as session:
        members = {one.name: one for one in session.scalars(select(Member))}
        assert {name: one.account for name, one in members.items()} == {"ada": "name:ada", ANONYMOUS: None}
        owners = {one.id: name for name, one in members.items()}
        handed_in = {row[0]: owners[row[1]] for row in session.execute(text("SELECT id, learner FROM submissions"))}
        assert handed_in == {f"{name}{number}": name for name in members for number in (1, 2)}
        keys = {
            owners[row[0]]: row[1]
            for row in session.execute(text("SELECT learner, submission_id FROM idempotency_keys"))
        }
        assert keys == {name: f"{name}2" for name in members}
        for name, member in members.items():
            assert session.get_one(Credential, name).member == member.id
        if database.is_sqlite:
            assert session.execute(text("PRAGMA foreign_key_check")).all() == []
