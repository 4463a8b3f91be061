"""Group commit: what waits is stored together, nobody is told before the commit, and the end loses nothing."""

import asyncio
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import chain
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from sqlalchemy import text
from sqlalchemy.exc import IntegrityError, OperationalError
from sqlalchemy.orm import Session

from grader.errors import Conflict, TooManyRequests
from grader.store.engine import group_commit
from grader.store.engine.database import Database
from grader.store.engine.group_commit import GroupCommit
from support.databases import BACKENDS, open_database

Store = Callable[[Session, Sequence[int]], Sequence[int | Exception]]


@pytest.fixture
def sqlite(tmp_path: Path) -> Iterator[Database]:
    database = Database(f"sqlite:///{tmp_path}/writer.db")
    yield database
    database.close()


@pytest.fixture(params=BACKENDS)
def database(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Database]:
    with open_database(request.param, tmp_path) as database:
        with database.write() as session:
            session.execute(text("CREATE TABLE notes (id int PRIMARY KEY)"))
        yield database


def notes(database: Database) -> Sequence[int]:
    with database.read() as session:
        return session.scalars(text("SELECT id FROM notes ORDER BY id")).all()


def insert_notes(session: Session, items: Sequence[int]) -> Sequence[int]:
    for item in items:
        session.execute(text("INSERT INTO notes VALUES (:id)"), {"id": item})
    return items


def put_together(database: Database, items: Sequence[int], store: Store) -> list[Any]:
    """The outcomes of items that wait before the thread starts: values, or the exceptions that were raised."""

    async def put() -> list[Any]:
        writer = GroupCommit(database, store)
        waiting = [asyncio.create_task(writer.put(item)) for item in items]
        await asyncio.sleep(0)
        writer.start()
        outcomes = await asyncio.gather(*waiting, return_exceptions=True)
        await asyncio.to_thread(writer.close)
        return outcomes

    return asyncio.run(asyncio.wait_for(put(), 60))


def insert_nothing(_session: Session, items: Sequence[int]) -> Sequence[int]:
    return items


class Batches:
    """Notes the items of each transaction; each waits until `go` is set."""

    def __init__(self) -> None:
        self.stored: list[list[int]] = []
        self.go = threading.Event()

    def store(self, _session: Session, items: Sequence[int]) -> Sequence[int]:
        self.stored.append(list(items))
        assert self.go.wait(60)
        return [10 * item for item in items]


def test_items_that_come_while_a_transaction_runs_are_stored_together(sqlite: Database) -> None:
    batches = Batches()

    async def put() -> list[int]:
        writer = GroupCommit(sqlite, batches.store)
        writer.start()
        tasks = [asyncio.create_task(writer.put(0))]
        while not batches.stored:
            await asyncio.sleep(0.001)
        tasks += [asyncio.create_task(writer.put(item)) for item in range(1, 20)]
        await asyncio.sleep(0)
        batches.go.set()
        outcomes = await asyncio.gather(*tasks)
        await asyncio.to_thread(writer.close)
        return outcomes

    assert asyncio.run(asyncio.wait_for(put(), 60)) == [10 * item for item in range(20)]
    assert batches.stored == [[0], list(range(1, 20))]


@pytest.mark.parametrize("before", [1, 2])
def test_after_several_items_the_next_ones_gather_a_moment(
    sqlite: Database, monkeypatch: pytest.MonkeyPatch, before: int
) -> None:
    batches = Batches()
    batches.go.set()
    monkeypatch.setattr(group_commit, "GATHER_S", 1.0)

    async def put() -> None:
        writer = GroupCommit(sqlite, batches.store)
        first = [asyncio.create_task(writer.put(item)) for item in range(before)]
        await asyncio.sleep(0)
        writer.start()
        await asyncio.gather(*first)
        others = [asyncio.create_task(writer.put(10))]
        await asyncio.sleep(0.1)
        others += [asyncio.create_task(writer.put(20))]
        await asyncio.gather(*others)
        await asyncio.to_thread(writer.close)

    asyncio.run(asyncio.wait_for(put(), 60))
    assert batches.stored[1:] == ([[10], [20]] if before == 1 else [[10, 20]])


@pytest.mark.parametrize(("coming", "gatherings"), [([0], 1), ([1], 1), ([3, 2, 1], 3), ([2] * 9, 5)])
def test_items_gather_again_while_several_more_come(
    sqlite: Database, monkeypatch: pytest.MonkeyPatch, coming: list[int], gatherings: int
) -> None:
    writer, slept = GroupCommit[int, int](sqlite, Batches().store), list[float]()

    def sleep(seconds: float) -> None:
        for _ in range(coming[len(slept)]):
            writer._queue.put(None)
        slept.append(seconds)

    monkeypatch.setattr(group_commit, "time", SimpleNamespace(sleep=sleep))
    writer._gather()
    assert slept == [group_commit.GATHER_S] * gatherings


def test_a_transaction_has_a_most_of_items(sqlite: Database, monkeypatch: pytest.MonkeyPatch) -> None:
    batches = Batches()
    batches.go.set()
    monkeypatch.setattr(group_commit, "BATCH_MAX", 8)
    put_together(sqlite, range(20), batches.store)
    assert [len(batch) for batch in batches.stored] == [8, 8, 4]


def test_what_waits_at_the_end_is_stored_and_nothing_more_is_taken(sqlite: Database) -> None:
    batches = Batches()

    async def put() -> None:
        writer = GroupCommit(sqlite, batches.store)
        writer.start()
        tasks = [asyncio.create_task(writer.put(item)) for item in range(3)]
        while not batches.stored:
            await asyncio.sleep(0.001)
        closing = asyncio.create_task(asyncio.to_thread(writer.close))
        await asyncio.sleep(0.05)
        with pytest.raises(TooManyRequests):
            await writer.put(3)
        batches.go.set()
        await asyncio.gather(closing, *tasks)

    asyncio.run(asyncio.wait_for(put(), 60))
    assert list(chain(*batches.stored)) == [0, 1, 2]


def test_too_many_that_wait_are_refused(sqlite: Database, monkeypatch: pytest.MonkeyPatch) -> None:
    batches = Batches()
    batches.go.set()
    monkeypatch.setattr(group_commit, "WAITING_MAX", 2)
    outcomes = put_together(sqlite, [1, 2, 3], batches.store)
    assert outcomes[:2] == [10, 20]
    assert isinstance(outcomes[2], TooManyRequests)
    assert batches.stored == [[1, 2]]


def test_an_event_loop_that_has_ended_stops_nobody_else(sqlite: Database) -> None:
    batches = Batches()
    writer = GroupCommit(sqlite, batches.store)
    writer.start()

    async def leave() -> None:
        asyncio.create_task(writer.put(0))  # noqa: RUF006  its client goes
        await asyncio.sleep(0)

    asyncio.run(leave())
    batches.go.set()
    assert asyncio.run(asyncio.wait_for(writer.put(1), 60)) == 10
    writer.close()
    assert list(chain(*batches.stored)) == [0, 1]


def test_nobody_is_told_before_the_commit(tmp_path: Path) -> None:
    order = []

    class Slow(Database):
        @contextmanager
        def write(self, *, hasty: bool = False) -> Iterator[Session]:
            with super().write(hasty=hasty) as session:
                yield session
                threading.Event().wait(0.05)  # the commit takes so long
            order.append("committed")

    database = Slow(f"sqlite:///{tmp_path}/slow.db")

    async def put() -> None:
        writer: GroupCommit[int, int] = GroupCommit(database, lambda _session, items: list(items))
        writer.start()
        await writer.put(7)
        order.append("told")
        await asyncio.to_thread(writer.close)

    asyncio.run(asyncio.wait_for(put(), 60))
    assert order == ["committed", "told"]
    database.close()


def test_an_item_that_is_refused_is_refused_alone(database: Database) -> None:
    def store(session: Session, items: Sequence[int]) -> Sequence[int | Exception]:
        insert_notes(session, [item for item in items if item != 2])
        return [Conflict("no") if item == 2 else item for item in items]

    outcomes = put_together(database, [1, 2, 3], store)
    assert (outcomes[0], type(outcomes[1]), outcomes[2]) == (1, Conflict, 3)
    assert notes(database) == [1, 3]


def test_a_row_that_the_database_refuses_fails_alone(database: Database) -> None:
    outcomes = put_together(database, [1, 2, 1, 3], insert_notes)
    assert (outcomes[0], outcomes[1], type(outcomes[2]), outcomes[3]) == (1, 2, IntegrityError, 3)
    assert notes(database) == [1, 2, 3]


def test_after_a_failed_commit_nothing_is_tried_again(tmp_path: Path) -> None:
    class Failing(Database):
        @contextmanager
        def write(self, *, hasty: bool = False) -> Iterator[Session]:
            with super().write(hasty=hasty) as session:
                yield session
            raise KeyError("nobody knows whether it was stored")

    database, tried = Failing(f"sqlite:///{tmp_path}/failing.db"), []

    def store(_session: Session, items: Sequence[int]) -> Sequence[int]:
        tried.append(list(items))
        return items

    assert [type(one) for one in put_together(database, [1, 2], store)] == [KeyError, KeyError]
    assert tried == [[1, 2]]
    database.close()


@pytest.mark.parametrize("database", ["postgresql"], indirect=True)
def test_without_the_database_nothing_is_tried_again(database: Database) -> None:
    tried = []

    def store(session: Session, items: Sequence[int]) -> Sequence[int]:
        tried.append(list(items))
        session.execute(text("SELECT pg_terminate_backend(pg_backend_pid())"))
        return items

    outcomes = put_together(database, [1, 2], store)
    assert [type(outcome) for outcome in outcomes] == [OperationalError, OperationalError]
    assert tried == [[1, 2]]
    assert put_together(database, [1], insert_notes) == [1]
