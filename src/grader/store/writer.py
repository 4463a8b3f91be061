"""One thread that stores whatever waits in one transaction, while more gathers: nobody waits for company."""

import asyncio
import threading
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from queue import SimpleQueue
from typing import Any, Generic, TypeVar

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
Result = TypeVar("Result")

log = structlog.get_logger()


@dataclass(eq=False)
class _Waiting(Generic[Item]):
    item: Item
    meanwhile: Callable[[], Any]
    done: asyncio.Future[Any]
    result: Any = None
    """What `meanwhile` returned or raised."""
    error: Exception | None = None
    """Why the item is not stored."""

    def prepare(self) -> None:
        """Calls `meanwhile`, unless its client has gone."""
        if self.done.done():
            return
        try:
            self.result = self.meanwhile()
        except Exception as error:
            self.result = error

    def wake(self) -> None:
        """Wakes the client, unless it has gone."""
        if self.done.done():
            return
        if self.error is not None:
            self.done.set_exception(self.error)
        elif isinstance(self.result, Exception):
            self.done.set_exception(self.result)
        else:
            self.done.set_result(self.result)


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

    async def put(self, item: Item, meanwhile: Callable[[], Result]) -> Result:
        """Returns once the item is committed; it is also stored if the caller has gone by then.

        What it returns is made by `meanwhile`: the event loop calls it after `keep`, while the database stores.
        Raises what `keep`, the commit or `meanwhile` raised, and TooManyRequests.
        """
        if self._closing or len(self._waiting) >= WAITING_MAX:
            raise TooManyRequests("Too many answers wait to be stored.", 1)
        loop = asyncio.get_running_loop()
        waiting = _Waiting(item, meanwhile, loop.create_future())
        self._waiting.append(waiting)
        if not self._is_gathering:
            self._is_gathering = True
            self._gather(loop, loop.time() + GATHERING_S)
        result: Result = await waiting.done
        return result

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
        loop = batch[0].done.get_loop()
        if not call_in(loop, self._wake, loop, batch):
            self._is_gathering = False

    def _wake(self, loop: asyncio.AbstractEventLoop, batch: Sequence[_Waiting[Item]]) -> None:
        for one in batch:
            one.wake()
        self._is_gathering = bool(self._waiting)
        if self._waiting:
            self._gather(loop, loop.time() + GATHERING_S)

    def _store(self, batch: list[_Waiting[Item]]) -> None:
        kept = False
        try:
            with self._database.write() as session:
                self._keep(session, [one.item for one in batch])
                kept = True
                call_in(batch[0].done.get_loop(), prepare, batch)
        except Exception as error:
            may_be_stored = kept and not isinstance(error, ROW_ERRORS)
            if may_be_stored or len(batch) == 1 or isinstance(error, OperationalError | InterfaceError):
                for one in batch:
                    one.error = error
                return
            log.warning("a batch failed, its items are stored one by one", error=type(error).__name__)
            for one in batch:
                self._store([one])


def prepare(batch: Sequence[_Waiting[Any]]) -> None:
    """Makes what is returned for the items of a batch."""
    for one in batch:
        one.prepare()


def call_in(loop: asyncio.AbstractEventLoop, function: Callable[..., None], *arguments: Any) -> bool:
    """Calls a function in an event loop. Returns False if the loop is closed: nobody waits for the call then."""
    try:
        loop.call_soon_threadsafe(function, *arguments)
    except RuntimeError:
        return False
    return True
