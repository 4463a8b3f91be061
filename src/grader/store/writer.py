"""One thread that stores whatever waits in one transaction, while more gathers: nobody waits for company."""

import asyncio
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from queue import SimpleQueue
from typing import Generic, TypeVar

import structlog
from sqlalchemy.exc import DataError, IntegrityError, InterfaceError, OperationalError
from sqlalchemy.orm import Session

from grader.errors import TooManyRequests
from grader.store.database import Database

BATCH_MAX = 200
"""Items of one transaction."""
WAITING_MAX = 2000
"""Items that may wait; more are refused."""
ROW_ERRORS = (IntegrityError, DataError)
"""What a database says of rows that it refuses, on PostgreSQL with the commit: nothing of the transaction is stored."""

Item = TypeVar("Item")

log = structlog.get_logger()


@dataclass(eq=False)
class _Waiting(Generic[Item]):
    item: Item
    done: asyncio.Future[None]
    error: Exception | None = None


class Writer(Generic[Item]):
    """Calls `keep` with the items that wait, in a transaction of `database`, and reports only after its commit.

    An item that breaks `keep`, or whose rows are refused, does so alone: the transaction is rolled back, and every item
    is tried by itself. After another failed commit, or without the database, nothing is tried again: an item that was
    stored would be stored twice.
    """

    def __init__(self, database: Database, keep: Callable[[Session, Sequence[Item]], None]) -> None:
        self._database, self._keep = database, keep
        self._queue: SimpleQueue[_Waiting[Item] | None] = SimpleQueue()
        self._thread = threading.Thread(target=self._run, name="writer", daemon=True)
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

    async def put(self, item: Item) -> None:
        """Returns once the item is committed; it is also stored if the caller has gone by then.

        Raises what `keep` or the commit raised, and TooManyRequests.
        """
        if self._closing or self._queue.qsize() >= WAITING_MAX:
            raise TooManyRequests("Too many answers wait to be stored.", 1)
        waiting = _Waiting(item, asyncio.get_running_loop().create_future())
        self._queue.put(waiting)
        await waiting.done

    def _run(self) -> None:
        while not (self._closing and self._queue.empty()):
            if waiting := [one for one in self._gathered() if one is not None]:
                self._store(waiting)
                tell(waiting)

    def _gathered(self) -> list[_Waiting[Item] | None]:
        """What waits, once there is something, and what the event loop reads while it has requests to read."""
        batch, before = [self._queue.get()], 0
        while before < len(batch) < BATCH_MAX:
            before = len(batch)
            time.sleep(0)  # the interpreter's lock goes to the event loop: larger transactions cost less
            while len(batch) < BATCH_MAX and not self._queue.empty():
                batch.append(self._queue.get())
        return batch

    def _store(self, batch: list[_Waiting[Item]]) -> None:
        kept = False
        try:
            with self._database.write() as session:
                self._keep(session, [one.item for one in batch])
                kept = True
        except Exception as error:
            may_be_stored = kept and not isinstance(error, ROW_ERRORS)
            if may_be_stored or len(batch) == 1 or isinstance(error, OperationalError | InterfaceError):
                for one in batch:
                    one.error = error
                return
            log.warning("a batch failed, its items are stored one by one", error=type(error).__name__)
            for one in batch:
                self._store([one])


def tell(batch: Sequence[_Waiting[Item]]) -> None:
    """Wakes those who wait for a batch: one call into their event loop for all of them."""

    def wake() -> None:
        for one in batch:
            if one.done.done():  # its client has gone
                continue
            if one.error is None:
                one.done.set_result(None)
            else:
                one.done.set_exception(one.error)

    with suppress(RuntimeError):  # the loop is closed: nobody waits any more
        batch[0].done.get_loop().call_soon_threadsafe(wake)
