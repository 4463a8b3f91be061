"""Simulates the queue of scripts: scripts arrive, and grading processes take them, each learner in turn.

The rule is that of `grader.queue.jobs`: waiting scripts are ordered in rounds, and a round holds at most one script of
each learner. Events are simulated one after the other, without random numbers of their own.
"""

import heapq
from collections.abc import Iterable, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Arrival:
    """A script: when it is handed in [s], by whom, and for how long a grading process works on it [s]."""

    time_s: float
    learner: int
    service_s: float = 0.0


class TurnQueue:
    """The waiting scripts in the order in which they are claimed; `grader.queue.jobs` does the same in a table."""

    def __init__(self) -> None:
        self._heap: list[tuple[int, int, int]] = []
        self._newest: dict[int, int] = {}
        self._last = 0

    def __len__(self) -> int:
        return len(self._heap)

    def put(self, learner: int, script: int) -> None:
        """Add a script in the first round that is behind the head of the queue and has none of this learner's."""
        if self._heap:
            head, place, _ = self._heap[0]
            first = head + (place > learner)
        else:
            first = self._last
        turn = max(first, self._newest.get(learner, first - 1) + 1)
        self._newest[learner] = turn
        heapq.heappush(self._heap, (turn, learner, script))

    def claim(self) -> int:
        """Remove the first script, and return it."""
        self._last, learner, script = heapq.heappop(self._heap)
        if self._newest[learner] == self._last:
            del self._newest[learner]  # no later one of this learner waits
        return script


def simulate_queue(arrivals: Sequence[Arrival], processes: int) -> list[float]:
    """Returns how long each script waits before a grading process takes it [s]. `arrivals` ascend in time."""
    queue, waits = TurnQueue(), [0.0] * len(arrivals)
    ends: list[float] = []

    def work_off(until_s: float) -> None:
        """Let processes that become free before this time take waiting scripts."""
        while queue and ends[0] <= until_s:
            take(queue.claim(), heapq.heappop(ends))

    def take(script: int, now_s: float) -> None:
        waits[script] = now_s - arrivals[script].time_s
        heapq.heappush(ends, now_s + arrivals[script].service_s)

    for script, arrival in enumerate(arrivals):
        work_off(arrival.time_s)
        while ends and ends[0] <= arrival.time_s:
            heapq.heappop(ends)
        if len(ends) < processes:
            take(script, arrival.time_s)
        else:
            queue.put(arrival.learner, script)
    work_off(float("inf"))
    return waits


def count_processes(arrivals: Sequence[Arrival], patience_s: float, share: float, candidates: Iterable[int]) -> int:
    """Returns the first of these numbers of processes with which this share of the scripts waits no longer [s]. Raises
    ValueError where none does."""
    for processes in candidates:
        if sum(wait <= patience_s for wait in simulate_queue(arrivals, processes)) >= share * len(arrivals):
            return processes
    raise ValueError("more processes are needed than were tried")
