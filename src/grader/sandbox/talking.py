"""Talks with the driver of a running script: the judge asks, step by step, and nothing that it does not send enters the
jail. The pipes are those of every run, served by the thread that watches the child. What comes back are claims: one
answer to each message, of limited length. A process that answers before it is asked, or too long, is ended."""

import os
import select
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from grader.domain.run import Channel, ChannelClosed, Job, MalformedAnswer
from grader.sandbox.usage import read_cpu_clock_s
from grader.sandbox.watch import CORES, POLL_S_MIN, Cause, Part, Watch, frame_part
from grader.sandbox.zygote import Child

REQUESTS = {False: 1, True: 2}
"""The requests that the child has made when it has its inputs, and when it has the hidden ones too."""


PASSING_S = 0.005
"""Time for which an answer may be late without counting as waiting of the script's [s]: on a busy machine it is ours:
the answer lies in the pipe until we get a core. Ten thousand answers may so take a minute more."""


HEARING_MS = 2
"""How long an answer is waited for before the other pipes are looked at."""


CORE_AT = 36
"""Where `stat` of a thread has the core it runs on, counted from behind its name: field 39, see proc(5)."""


@contextmanager
def share_core(pid: int) -> Iterator[None]:
    """Keeps this thread and a process, which take turns, on the core where this thread is. To wake a process on a core
    that sleeps takes some 40 us on a virtual machine, more than a step of ours; to hand over the core takes 5."""
    cores = os.sched_getaffinity(0)
    core = int(Path("/proc/thread-self/stat").read_text().rpartition(")")[2].split()[CORE_AT])
    try:
        with suppress(OSError):  # it has ended, or may not be moved; it is as right on two cores
            os.sched_setaffinity(pid, {core})
            os.sched_setaffinity(0, {core})
        yield
    finally:
        os.sched_setaffinity(0, cores)


class TalkingWatch(Watch):
    """A watch of a job with a `talk`, to which it is the channel."""

    def __init__(self, child: Child, job: Job, parts: Sequence[Part], *, without_integrators: bool) -> None:
        super().__init__(child, job, parts, without_integrators=without_integrators)
        assert job.talk is not None
        self._talk_with: Callable[[Channel], object] = job.talk
        self._heard = job.heard
        self._talks, self._ended = True, False
        self._part_ends_cpu_s = float("inf")
        self._answers = select.poll()
        self._answers.register(child.results, select.POLLIN)

    def ask(self, message: bytes) -> bytes:
        """Send a message and return the answer. Raises ChannelClosed."""
        if self._wants.answer is not None:
            self._wants.unasked = True
        else:
            self._send(message)
        asked_at = time.monotonic()
        self._serve_until(lambda: self._wants.answer is not None and not self._wants.unasked)
        answer, self._wants.answer = self._wants.answer, None
        assert answer is not None
        self._aside_s += min(PASSING_S, time.monotonic() - asked_at)
        return answer

    def end(self) -> None:
        """Tell the driver that the messages of one trial end here."""
        self._send(b"")

    def wait_for_hidden(self) -> None:
        """Wait until the child has the hidden inputs; what it prints from then on is dropped. Raises ChannelClosed."""
        self._serve_until(lambda: self._answered >= REQUESTS[True] and not self._unsent)

    def limit(self, cpu_s: float) -> None:
        """Allow this much CPU time from now on [s], until the next call."""
        used_s = (read_cpu_clock_s(self._child.pid) or 0.0) - self._usage.cpu_before_s
        self._part_ends_cpu_s = used_s + cpu_s
        self._check_at = 0.0

    def tell(self, name: str) -> None:
        """Tell the job's listener that a part is done."""
        self._heard(name)

    def _talk(self) -> Any:
        """Return what the job's `talk` returns; None if it lets ChannelClosed pass, or the script's process lies."""
        talked = None
        try:
            self._left_at = time.monotonic()
            self._serve_until(lambda: self._answered >= REQUESTS[False] and not self._unsent)
            with share_core(self._child.pid):
                talked = self._talk_with(self)
        except ChannelClosed:
            pass
        except MalformedAnswer:
            self._cause = self._cause or Cause.ANSWER
        self._aside_s += time.monotonic() - self._left_at
        self._talks = False
        self._part_ends_cpu_s = float("inf")
        if not self._unsent and self._is_whole():
            self._child.hang_up()
        return talked

    def _serve_until(self, done: Callable[[], bool]) -> None:
        """Serve the child until `done`, or its end. The time that has passed since it was served last was the judge's:
        that the child waited then is not its fault."""
        self._aside_s += time.monotonic() - self._left_at
        if not done():
            self._hear()
        while not done():
            if self._wants.unasked and self._cause is None:
                self._cause = Cause.ANSWER
            if self._ended or self._cause is not None:
                self._left_at = time.monotonic()
                raise ChannelClosed
            self._ended = self._serve()
        self._left_at = time.monotonic()

    def _hear(self) -> None:
        """Wait a moment for the answer alone. Most come at once, and to look at every pipe takes longer than they do;
        what the script prints meanwhile lies in its pipe."""
        is_due = self._cause is not None or bool(self._unsent) or time.monotonic() >= self._check_at
        if not is_due and self._answers.poll(HEARING_MS):
            self._take(self._child.results)

    def _is_whole(self) -> bool:
        return not self._talks and super()._is_whole()

    def _send(self, part: bytes) -> None:
        """Send a part at once if nothing waits before it, and the pipe has room."""
        if self._unsent or self._child.job < 0:
            super()._send(part)
            return
        framed = frame_part(part)
        try:
            sent = os.write(self._child.job, framed)
        except BlockingIOError:
            sent = 0
        except BrokenPipeError:
            return
        if sent < len(framed):
            super()._send(part)
            self._unsent = self._unsent[sent:]

    def _patience(self) -> float:
        return min(super()._patience(), max(POLL_S_MIN, (self._part_ends_cpu_s - self._usage.cpu_s) / CORES))

    def _check_limits(self) -> None:
        super()._check_limits()
        if self._cause is None and self._usage.cpu_s >= self._part_ends_cpu_s:
            self._cause = Cause.PART
