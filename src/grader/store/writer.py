"""One thread that stores whatever waits in one transaction, while more gathers: nobody waits for company."""

import asyncio
import threading
from collections import deque
from collections.abc import Callable, Sequence
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
QUIET_TURNS = 5
"""Turns of the event loop without a new item after which the thread stores those that wait; a request takes two.

Larger transactions cost less, and a thread at work beside a busy event loop costs both of them a third more.
"""
GATHERING_S = 0.01
"""It stores them after so long in any case [s]: turns are long while the event loop has other requests."""
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
        self._waiting: deque[_Waiting[Item]] = deque()
        self._due: SimpleQueue[None] = SimpleQueue()
        self._thread = threading.Thread(target=self._run, name="writer", daemon=True)
        self._is_gathering = self._closing = False

    def start(self) -> None:
        """Starts the thread."""
        self._thread.start()

    def close(self) -> None:
        """Stores what waits, and ends the thread."""
        self._closing = True
        if self._thread.ident is not None:
            self._due.put(None)
            self._thread.join()

    async def put(self, item: Item) -> None:
        """Returns once the item is committed; it is also stored if the caller has gone by then.

        Raises what `keep` or the commit raised, and TooManyRequests.
        """
        if self._closing or len(self._waiting) >= WAITING_MAX:
            raise TooManyRequests("Too many answers wait to be stored.", 1)
        loop = asyncio.get_running_loop()
        waiting = _Waiting(item, loop.create_future())
        self._waiting.append(waiting)
        if not self._is_gathering:
            self._is_gathering = True
            self._gather(loop, loop.time() + GATHERING_S)
        await waiting.done

    def _gather(self, loop: asyncio.AbstractEventLoop, until: float, before: int = 0, quiet_turns: int = 0) -> None:
        """Lets the thread store what waits, as soon as the event loop has nothing more to read."""
        count = len(self._waiting)
        quiet_turns = quiet_turns + 1 if count == before else 0
        if quiet_turns < QUIET_TURNS and count < BATCH_MAX and loop.time() < until:
            loop.call_soon(self._gather, loop, until, count, quiet_turns)
        else:
            self._due.put(None)

    def _run(self) -> None:
        while True:
            self._due.get()
            while batch := [self._waiting.popleft() for _ in range(min(len(self._waiting), BATCH_MAX))]:
                self._store(batch)
                self._tell(batch)
                if not self._closing:
                    break
            if self._closing:
                return

    def _tell(self, batch: Sequence[_Waiting[Item]]) -> None:
        """Wakes those who wait for a batch: one call into their event loop for all of them."""
        loop = batch[0].done.get_loop()
        try:
            loop.call_soon_threadsafe(self._wake, loop, batch)
        except RuntimeError:  # the loop is closed: nobody waits any more
            self._is_gathering = False

    def _wake(self, loop: asyncio.AbstractEventLoop, batch: Sequence[_Waiting[Item]]) -> None:
        for one in batch:
            if one.done.done():  # its client has gone
                continue
            if one.error is None:
                one.done.set_result(None)
            else:
                one.done.set_exception(one.error)
        self._is_gathering = bool(self._waiting)
        if self._waiting:
            self._gather(loop, loop.time() + GATHERING_S)

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
