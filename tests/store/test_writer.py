"""The writer: what comes together is stored together, nobody waits for long, and the end loses nothing."""

import asyncio
import threading
from collections.abc import AsyncIterator, Iterator, Sequence
from contextlib import asynccontextmanager, contextmanager
from itertools import chain
from pathlib import Path

import pytest
from sqlalchemy import text
from sqlalchemy.exc import OperationalError
from sqlalchemy.orm import Session

from grader.errors import TooManyRequests
from grader.store import writer as writers
from grader.store.database import Database
from grader.store.writer import Writer


@pytest.fixture
def database(tmp_path: Path) -> Iterator[Database]:
    database = Database(f"sqlite:///{tmp_path}/writer.db")
    yield database
    database.close()


def nothing() -> None:
    """Makes nothing meanwhile."""


class Batches:
    """Keeps the items of each transaction."""

    def __init__(self, database: Database) -> None:
        self.kept: list[list[int]] = []
        self.writer: Writer[int] = Writer(database, self.keep)

    def keep(self, _session: Session, items: Sequence[int]) -> None:
        self.kept.append(list(items))

    @asynccontextmanager
    async def started(self) -> AsyncIterator[Writer[int]]:
        self.writer.start()
        yield self.writer
        await asyncio.to_thread(self.writer.close)


def test_items_that_come_in_several_turns_of_the_event_loop_are_stored_together(
    database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    batches = Batches(database)
    monkeypatch.setattr(writers, "GATHERING_S", 3600.0)

    async def put() -> None:
        async with batches.started() as writer:
            tasks = []
            for item in range(20):
                tasks.append(asyncio.create_task(writer.put(item, nothing)))
                await asyncio.sleep(0)
                await asyncio.sleep(0)
            await asyncio.gather(*tasks)

    asyncio.run(put())
    assert batches.kept == [list(range(20))]


def test_no_item_waits_for_an_event_loop_that_is_never_quiet(
    database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    batches = Batches(database)
    monkeypatch.setattr(writers, "BATCH_MAX", 10**6)
    monkeypatch.setattr(writers, "WAITING_MAX", 10**6)  # thousands come in GATHERING_S

    async def put() -> None:
        async with batches.started() as writer:
            tasks = [asyncio.create_task(writer.put(0, nothing))]
            while not tasks[0].done():  # a new item in every turn
                tasks.append(asyncio.create_task(writer.put(len(tasks), nothing)))
                await asyncio.sleep(0)
            await asyncio.gather(*tasks)

    asyncio.run(put())
    assert len(batches.kept) > 1
    assert list(chain(*batches.kept)) == list(range(sum(map(len, batches.kept))))


def test_a_transaction_has_a_most_of_items(database: Database, monkeypatch: pytest.MonkeyPatch) -> None:
    batches = Batches(database)
    monkeypatch.setattr(writers, "BATCH_MAX", 8)

    async def put() -> None:
        async with batches.started() as writer:
            await asyncio.gather(*(writer.put(item, nothing) for item in range(20)))

    asyncio.run(put())
    assert [len(batch) for batch in batches.kept] == [8, 8, 4]


def test_what_waits_at_the_end_is_stored_and_nothing_more_is_taken(
    database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    batches = Batches(database)
    monkeypatch.setattr(writers, "GATHERING_S", 3600.0)
    monkeypatch.setattr(writers, "QUIET_TURNS", 10**9)

    async def put() -> None:
        async with batches.started() as writer:
            tasks = [asyncio.create_task(writer.put(item, nothing)) for item in range(3)]
            await asyncio.sleep(0.01)
            assert not batches.kept
            await asyncio.to_thread(writer.close)
            await asyncio.gather(*tasks)
            with pytest.raises(TooManyRequests):
                await writer.put(3, nothing)

    asyncio.run(asyncio.wait_for(put(), 60))
    assert batches.kept == [[0, 1, 2]]


def test_too_many_that_wait_are_refused(database: Database, monkeypatch: pytest.MonkeyPatch) -> None:
    batches = Batches(database)
    monkeypatch.setattr(writers, "WAITING_MAX", 2)

    async def put() -> list[object]:
        tasks = [asyncio.create_task(batches.writer.put(item, nothing)) for item in range(3)]
        await asyncio.sleep(0)
        async with batches.started():
            return await asyncio.gather(*tasks, return_exceptions=True)

    said = asyncio.run(put())
    assert [type(one) for one in said] == [type(None), type(None), TooManyRequests]
    assert batches.kept == [[0, 1]]


def test_an_event_loop_that_has_ended_stops_nobody_else(database: Database) -> None:
    batches = Batches(database)

    async def leave() -> None:
        asyncio.create_task(batches.writer.put(0, nothing))  # noqa: RUF006  its client goes
        await asyncio.sleep(0)
        await asyncio.sleep(0.01)

    asyncio.run(leave())

    async def put() -> None:
        async with batches.started() as writer:
            while not batches.kept:
                await asyncio.sleep(0.001)
            await writer.put(1, nothing)

    asyncio.run(asyncio.wait_for(put(), 60))
    assert batches.kept == [[0], [1]]


def test_what_is_made_meanwhile_is_made_before_the_commit_and_told_after_it(tmp_path: Path) -> None:
    order = []
    made = threading.Event()

    class Slow(Database):
        @contextmanager
        def write(self, *, hasty: bool = False) -> Iterator[Session]:
            with super().write(hasty=hasty) as session:
                yield session
                assert made.wait(60)  # the commit takes until then
                order.append("committed")

    database = Slow(f"sqlite:///{tmp_path}/slow.db")
    batches = Batches(database)

    def make() -> str:
        assert batches.kept == [[7]]
        order.append("made")
        made.set()
        return "a response"

    async def put() -> str:
        async with batches.started() as writer:
            return await writer.put(7, make)

    assert asyncio.run(asyncio.wait_for(put(), 60)) == "a response"
    assert order == ["made", "committed"]
    database.close()


def test_an_error_in_what_is_made_meanwhile_is_told_and_the_item_stored(database: Database) -> None:
    batches = Batches(database)

    def fail() -> None:
        raise KeyError("refused")

    async def put() -> Sequence[object]:
        async with batches.started() as writer:
            return await asyncio.gather(writer.put(0, fail), writer.put(1, lambda: "made"), return_exceptions=True)

    refused, made = asyncio.run(put())
    assert isinstance(refused, KeyError)
    assert made == "made"
    assert batches.kept == [[0, 1]]


def test_what_was_made_meanwhile_is_dropped_where_nothing_was_stored(database: Database) -> None:
    made = []

    class Failing(Batches):
        def keep(self, session: Session, items: Sequence[int]) -> None:
            super().keep(session, items)
            session.execute(text("CREATE TABLE once (a int)"))
            session.execute(text("INSERT INTO nowhere VALUES (1)"))

    async def put() -> Sequence[object]:
        async with Failing(database).started() as writer:
            return await asyncio.gather(writer.put(0, lambda: made.append(0)), return_exceptions=True)

    assert isinstance(asyncio.run(put())[0], OperationalError)
    assert not made
