"""Group commit: stores many items in one transaction, so that they share one commit. Why: a commit waits for the disk,
and takes longer than all statements of an answer together. With a transaction for each answer a class that answers at
once would wait in a queue; with one for all that wait, the queue stays short.

How: requests put items, and one thread stores them. It takes all items that wait, stores them in one transaction,
commits, and only then lets their requests go on: what a client was told is on the disk. Meanwhile the next items
gather. It is ordinary SQLAlchemy in an ordinary transaction; the caller says how items are stored."""

import asyncio
import threading
import time
from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from queue import Empty, SimpleQueue
from typing import Any, Generic, TypeVar

import structlog
from sqlalchemy.exc import InterfaceError, OperationalError
from sqlalchemy.orm import Session

from grader.errors import TooManyRequests
from grader.store.engine.database import Database

BATCH_MAX = 200
"""Items of one transaction."""
GATHER_S = 0.001
"""How long items gather where several came at once [s], and again while several more come: larger transactions cost
less, and the event loop, which takes the next ones meanwhile, has the interpreter to itself. An item that comes alone
is stored at once."""
GATHERINGS_MAX = 5
"""How often items gather before a transaction."""
WAITING_MAX = 2000
"""Items that may wait; more are refused."""

Item = TypeVar("Item")
Outcome = TypeVar("Outcome")

log = structlog.get_logger()


@dataclass(frozen=True, eq=False)
class PendingItem(Generic[Item]):
    """An item that waits to be stored, and the future of its request."""

    item: Item
    future: asyncio.Future[Any]

    def resolve(self, outcome: Any) -> None:
        """Lets the request go on with the outcome, or raises it there; the request may have gone."""
        if self.future.done():
            return
        if isinstance(outcome, Exception):
            self.future.set_exception(outcome)
        else:
            self.future.set_result(outcome)


def resolve_all(batch: Sequence[PendingItem[Any]], outcomes: Sequence[Any]) -> None:
    """Lets the requests of a batch go on, each in its own event loop; a server has one."""
    by_loop = defaultdict[asyncio.AbstractEventLoop, list[tuple[PendingItem[Any], Any]]](list)
    for pending, outcome in zip(batch, outcomes, strict=True):
        by_loop[pending.future.get_loop()].append((pending, outcome))
    for loop, pairs in by_loop.items():
        with suppress(RuntimeError):  # the event loop is closed, and its requests have ended
            loop.call_soon_threadsafe(resolve_each, pairs)


def resolve_each(pairs: Iterable[tuple[PendingItem[Any], Any]]) -> None:
    """Resolves items, in their event loop."""
    for pending, outcome in pairs:
        pending.resolve(outcome)


class GroupCommit(Generic[Item, Outcome]):
    """Calls `store` with the items that wait, in a transaction of `database`. `store` returns an outcome for each item,
    in their order: a value, or an exception that refuses the item alone.

    If `store` raises, the transaction is rolled back, and every item is tried by itself: a faulty one fails alone.
    After a failed commit, or without the database, nothing is tried again: an item might be stored twice."""

    def __init__(
        self, database: Database, store: Callable[[Session, Sequence[Item]], Sequence[Outcome | Exception]]
    ) -> None:
        self._database, self._store = database, store
        self._queue: SimpleQueue[PendingItem[Item] | None] = SimpleQueue()
        self._thread = threading.Thread(target=self._run, name="group-commit", daemon=True)
        self._closing = False

    def start(self) -> None:
        """Starts the thread."""
        self._thread.start()

    def close(self) -> None:
        """Stores what waits, and ends the thread."""
        self._closing = True
        if self._thread.ident is not None:
            self._queue.put(None)
            self._thread.join()

    async def put(self, item: Item) -> Outcome:
        """Stores an item, and returns its outcome after the commit. It is stored even if the caller is cancelled.
        Raises the item's outcome if that is an exception, what the commit raised, and TooManyRequests."""
        if self._closing or self._queue.qsize() >= WAITING_MAX:
            raise TooManyRequests("Too many answers wait to be stored.", 1)
        pending = PendingItem(item, asyncio.get_running_loop().create_future())
        self._queue.put(pending)
        outcome: Outcome = await pending.future
        return outcome

    def _run(self) -> None:
        batch: list[PendingItem[Item]] = []
        while (first := self._queue.get()) is not None:
            if len(batch) > 1:
                self._gather()
            batch = [first, *self._take_waiting(BATCH_MAX - 1)]
            self._store_batch(batch)

    def _gather(self) -> None:
        for _ in range(GATHERINGS_MAX):
            waiting = self._queue.qsize()
            time.sleep(GATHER_S)
            if self._queue.qsize() < waiting + 2:
                break

    def _take_waiting(self, count_max: int) -> list[PendingItem[Item]]:
        """Takes the items that wait now, at most `count_max`."""
        taken: list[PendingItem[Item]] = []
        while len(taken) < count_max:
            try:
                pending = self._queue.get_nowait()
            except Empty:
                break
            if pending is None:  # the end; it stays last in the queue
                self._queue.put(None)
                break
            taken.append(pending)
        return taken

    def _store_batch(self, batch: Sequence[PendingItem[Item]]) -> None:
        outcomes: Sequence[Outcome | Exception]
        is_committing = False
        try:
            with self._database.write() as session:
                outcomes = self._store(session, [pending.item for pending in batch])
                session.flush()
                is_committing = True
        except Exception as error:
            if not is_committing and len(batch) > 1 and not isinstance(error, OperationalError | InterfaceError):
                log.warning("a batch failed, its items are stored one by one", error=type(error).__name__)
                for pending in batch:
                    self._store_batch([pending])
                return
            outcomes = [error] * len(batch)
        resolve_all(batch, outcomes)
