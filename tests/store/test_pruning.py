"""Pruning deletes what is old and done with, and nothing else."""

from collections.abc import Iterator
from datetime import timedelta
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import event, func, select, update
from sqlalchemy.engine import Engine

from grader.courses.people import members
from grader.courses.people.identity import Role
from grader.courses.people.sign_in import PRUNED, start_session
from grader.domain.verdict import Status, Verdict
from grader.store import submissions
from grader.store.engine.database import Database
from grader.store.events import events_after
from grader.store.results import list_instructors
from grader.store.tables import Base, Credential, Event, IdempotencyKey, Member, Submission, now
from grader.store.upkeep import pruning
from support.databases import BACKENDS, open_database

OLD, LIMIT = timedelta(days=40), timedelta(days=30)
VERDICT = Verdict(status=Status.CORRECT, points=1, max_points=1)


@pytest.fixture(params=BACKENDS)
def database(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Database]:
    with open_database(request.param, tmp_path) as database:
        yield database


def hand_in(database: Database, age: timedelta, number: int, *, graded: bool = True) -> str:
    """A script of that age, with its idempotency key; three events if it is graded, else two."""
    made = now() - age
    key = f"{number:032d}"
    with database.write() as session:
        row = Submission(
            id=key,
            course="c",
            learner="l",
            user="ada",
            quiz="z",
            question="q",
            answer="1",
            content_digest="d",
            attempt=1,
        )
        submissions.add(session, [(row, None)])
        session.add(
            IdempotencyKey(
                course="c",
                learner="l",
                key=key,
                request_digest="d",
                submission_id=key,
                http_status=202,
                created_at=made,
            )
        )
        submissions.start(session, key)
        session.flush()
        if graded:
            submissions.append_verdict(session, session.get_one(Submission, key), VERDICT, "grading")
    with database.write() as session:
        session.execute(update(Event).where(Event.submission_id == key).values(created_at=made))
    return key


def count(database: Database, table: type[Base]) -> int:
    with database.read() as session:
        return session.scalar(select(func.count()).select_from(table)) or 0


def test_old_keys_and_passed_events_go_in_small_batches(database: Database, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pruning, "BATCH", 3)
    old = [hand_in(database, OLD, number) for number in range(5)]
    unfinished = hand_in(database, OLD, 5, graded=False)
    recent = hand_in(database, timedelta(), 6)
    before = now() - LIMIT
    assert pruning.idempotency_keys(database, before) == 6
    assert pruning.prune_events(database, before) == 10
    assert count(database, IdempotencyKey) == 1
    with database.read() as session:
        left = {key: [one.name for one in events_after(session, key, 0)] for key in (*old, unfinished, recent)}
    assert [left.pop(key) for key in old] == [["graded"]] * 5
    assert left == {unfinished: ["queued", "running"], recent: ["queued", "running", "graded"]}
    assert pruning.prune(database, LIMIT) == 0


def test_sqlite_finds_each_row_that_is_deleted_by_its_key(tmp_path: Path) -> None:
    plans = list[str]()

    def explain(connection: Any, _cursor: Any, statement: str, parameters: Any, *_: Any) -> None:
        if statement.startswith("DELETE"):
            one = parameters[0] if isinstance(parameters, list) else parameters
            explained = connection.connection.execute(f"EXPLAIN QUERY PLAN {statement}", one)
            plans.extend(row[3] for row in explained)

    with open_database("sqlite", tmp_path) as database:
        hand_in(database, OLD, 1)
        hand_in(database, OLD, 2)
        event.listen(Engine, "before_cursor_execute", explain)
        try:
            assert pruning.prune(database, LIMIT) == 6
        finally:
            event.remove(Engine, "before_cursor_execute", explain)
    assert len(plans) == 2
    assert all(plan.startswith("SEARCH ") for plan in plans), plans


def test_a_listener_hears_the_last_event_and_numbers_go_on(database: Database) -> None:
    key = hand_in(database, OLD, 1)
    pruning.prune_events(database, now() - LIMIT)
    with database.write() as session:
        submissions.append_verdict(session, session.get_one(Submission, key), VERDICT, "regrade")
    with database.read() as session:
        assert [one.number for one in events_after(session, key, 2)] == [3, 4]


def test_ended_sessions_go_with_members_who_have_no_other_way_back(database: Database) -> None:
    with database.write() as session:
        tina = members.get_named(session, "tina", Role.INSTRUCTOR)
        session.flush()
        for member in (tina, members.make_unnamed(session), members.make_unnamed(session)):
            start_session(session, member)
    with database.write() as session:
        kept = session.scalars(select(Member.id).where(Member.account.is_(None))).first()
        ended = update(Credential).where(Credential.member != kept)
        session.execute(ended.values(expires_at=now() - OLD))
    assert pruning.ended_credentials(database, PRUNED, now() - LIMIT) == 2
    with database.read() as session:
        assert set(session.scalars(select(Credential.member))) == {kept}
        assert set(session.scalars(select(Member.id))) == {kept, tina.id}
        assert list_instructors(session, "default") == {tina.id}  # their tries still do not count as a learner's


def test_events_of_nothing_are_nothing(database: Database) -> None:
    assert pruning.prune_events(database, now()) == count(database, Event) == 0
