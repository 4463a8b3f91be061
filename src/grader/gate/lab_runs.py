"""Lab runs: in a few threads of their own, in turn by learner, each made once and then kept."""

import asyncio
import time
from collections import OrderedDict, deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

from grader.errors import TooManyRequests
from grader.gate.rate import RateLimit

THREADS = 2
WAITING_MAX = 8
"""Runs of one learner that may wait or be in progress; the page asks for one at a time."""

STEP_CPU_S = 10e-6
"""CPU time that counts as one step where a run takes more of it, for instance because it failed."""

Who = tuple[str, str]


class Recording(NamedTuple):
    """A finished run: the compressed response, and how many steps it took."""

    packed: bytes
    steps: int


class LabRuns:
    """Runs labs for learners. For the event loop; only `make` runs in a thread. The same run, bit for bit, is kept in a
    least-recently-used cache of `bytes_max` bytes; a run in progress is shared. Either costs a learner nothing. A new
    run is paid by the learner who asked first, out of `steps_per_min`, when its steps are known."""

    def __init__(self, bytes_max: int, steps_per_min: int) -> None:
        self._bytes_max, self._bytes, self._free = bytes_max, 0, THREADS
        self._cache: OrderedDict[str, bytes] = OrderedDict()
        self._in_progress: dict[str, tuple[Who, asyncio.Task[bytes]]] = {}
        self._queues: OrderedDict[Who, deque[asyncio.Future[None]]] = OrderedDict()
        self._threads = ThreadPoolExecutor(THREADS, thread_name_prefix="lab")
        refusal = f"Your labs have simulated more than {steps_per_min} steps a minute; wait a little."
        self._budget = RateLimit(steps_per_min / 60, steps_per_min, refusal=refusal)

    async def get(self, who: Who, digest: str, make: Callable[[], Recording]) -> bytes:
        """The response of the run with this digest; calls `make` if it is neither kept nor in progress. Raises
        TooManyRequests, and what `make` raises."""
        while digest not in self._cache:
            if digest not in self._in_progress:
                self._start(who, digest, make)
            payer, shared = self._in_progress[digest]
            try:
                return await asyncio.shield(shared)
            except TooManyRequests:  # when its turn came, the budget was spent
                if payer == who:
                    raise
        self._cache.move_to_end(digest)
        return self._cache[digest]

    def close(self) -> None:
        """Starts no further run."""
        self._threads.shutdown(wait=False, cancel_futures=True)

    def _start(self, payer: Who, digest: str, make: Callable[[], Recording]) -> None:
        self._budget.require(payer)
        if sum(other == payer for other, _ in self._in_progress.values()) >= WAITING_MAX:
            raise TooManyRequests(f"{WAITING_MAX} of your lab runs are not finished yet; wait for them.", 1)
        task = asyncio.create_task(self._run(payer, digest, make))
        self._in_progress[digest] = payer, task
        task.add_done_callback(lambda _: self._in_progress.pop(digest))

    async def _run(self, who: Who, digest: str, make: Callable[[], Recording]) -> bytes:
        """Waits for the learner's turn, runs, charges and keeps."""
        await self._wait_for_turn(who)
        try:
            self._budget.require(who)
            steps, cpu_s, outcome = await asyncio.get_running_loop().run_in_executor(self._threads, run_timed, make)
        finally:
            self._free += 1
            self._start_next()
        self._budget.charge(who, max(steps, cpu_s / STEP_CPU_S))
        if isinstance(outcome, Exception):
            raise outcome
        self._store(digest, outcome)
        return outcome

    async def _wait_for_turn(self, who: Who) -> None:
        """Waits for a free thread, which goes to the learners in rotation."""
        turn: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._queues.setdefault(who, deque()).append(turn)
        self._start_next()
        await turn

    def _start_next(self) -> None:
        """Gives free threads to the learners whose last turn was longest ago."""
        while self._free and self._queues:
            who, queue = self._queues.popitem(last=False)
            if not (turn := queue.popleft()).cancelled():
                turn.set_result(None)
                self._free -= 1
            if queue:
                self._queues[who] = queue

    def _store(self, digest: str, packed: bytes) -> None:
        self._cache[digest] = packed
        self._bytes += len(packed)
        while self._bytes > self._bytes_max:
            self._bytes -= len(self._cache.popitem(last=False)[1])


def run_timed(make: Callable[[], Recording]) -> tuple[int, float, bytes | Exception]:
    """Steps, CPU time [s], and the response or the exception of a run: a failed one is paid too."""
    began = time.thread_time()
    try:
        packed, steps = make()
    except Exception as error:
        return 0, time.thread_time() - began, error
    return steps, time.thread_time() - began, packed
