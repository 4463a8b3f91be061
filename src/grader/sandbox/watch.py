"""Watches one run from outside: serves its pipes, checks its limits, and kills it when one is reached."""

import json
import os
import selectors
import signal
import struct
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from grader.domain.run import Job, ignore
from grader.errors import JailFault
from grader.sandbox.frames import WANTS_MAX, WantCounter
from grader.sandbox.policy import KB, MB, RESIDENT_EXTRA, RESULT_BYTES_MAX
from grader.sandbox.usage import Usage, count_oom_kills
from grader.sandbox.zygote import Child

READ_BYTES = 1 << 16
POLL_S_MIN, POLL_S_MAX = 0.005, 0.1
CORES = os.cpu_count() or 1
DEATH_S_MAX = 20.0


class Cause(StrEnum):
    """The limit at which the supervisor ended a run, or that it was stopped."""

    CPU = "cpu"
    WALL = "wall"
    MEMORY = "memory"
    OUTPUT = "output"
    RESULTS = "results"
    STOP = "stop"
    PART = "part"
    ANSWER = "answer"


@dataclass(frozen=True)
class Ending:
    """How a run ended, seen from outside; only the streams come from the script. `late_stderr` was written after the
    hidden inputs had been asked for; what was written to stdout then is dropped."""

    cause: Cause | None
    wait_status: int
    cpu_s: float
    wall_s: float
    stdout: bytes
    stderr: bytes
    results: bytes
    oom_killed: bool = False
    stepped: int = 0
    late_stderr: bytes = b""
    hidden_sent: bool = False
    talked: Any = None


Part = Callable[[], bytes]
"""Makes a part of a job."""


def frame_part(part: bytes) -> bytes:
    """Returns a part of a job behind its size, as the child reads it."""
    return struct.pack("<I", len(part)) + part


class Watch:
    """Sends one job to a child, and watches it until it is dead. `parts` are the job, its inputs and, if there are any,
    its hidden inputs. The job is sent at once, each further part is made and sent when the child asks for it. The
    inputs of a job `without_integrators` are sent after these have been removed: a script that knew its inputs earlier
    could still step them. The output is read before the hidden inputs are sent; output after that is dropped, as it may
    reveal them."""

    def __init__(self, child: Child, job: Job, parts: Sequence[Part], *, without_integrators: bool) -> None:
        self._child, self._limits, self._sent, self._is_stopped = child, job.limits, job.sent, job.is_stopped
        first, *self._withheld = parts
        self._unsent = memoryview(frame_part(first()))
        self._wants, self._answered = WantCounter(job.heard, takes_answers=job.talk is not None), 0
        self._without_integrators, self._removing = without_integrators, False
        self._late = {child.stdout: bytearray(), child.stderr: bytearray()}
        self._hidden_sent = False
        self._last = b""
        self._killed_at: float | None = None
        self._check_at = 0.0
        self._aside_s = 0.0
        """Time in which the script waited for us [s]."""
        self._read = {child.stdout: bytearray(), child.stderr: bytearray(), child.results: bytearray()}
        self._caps = {
            child.stdout: (job.limits.output_kb * KB, Cause.OUTPUT),
            child.stderr: (job.limits.output_kb * KB, Cause.OUTPUT),
            child.results: (RESULT_BYTES_MAX, Cause.RESULTS),
        }
        self._cause: Cause | None = None
        self._selector = selectors.PollSelector()

    def run(self) -> Ending:
        """Block until the child is dead and its output is read. Raises JailFault if it cannot be killed, or the keeper
        that must tell how it ended is gone."""
        child, killed_before = self._child, count_oom_kills()
        self._usage = Usage(child.pid)
        for descriptor in (*self._read, child.status.fileno(), child.pidfd):
            self._selector.register(descriptor, selectors.EVENT_READ)
        self._selector.register(child.job, selectors.EVENT_WRITE)
        with self._selector:
            talked = self._talk()
            while not self._serve():
                pass
            self._drain()
        wall_s = self._usage.wall_s
        last = self._final_report()
        killed = os.WIFSIGNALED(last["ended"]) and os.WTERMSIG(last["ended"]) == signal.SIGKILL
        oom_killed = (child.group is not None and child.group.ran_out()) or (
            killed and self._cause is None and count_oom_kills() > killed_before
        )
        stdout, stderr, results = (bytes(buffer) for buffer in self._read.values())
        cpu_s = max(0.0, last["cpu_s"] - self._usage.cpu_before_s)
        return Ending(
            self._cause, last["ended"], cpu_s, wall_s, stdout, stderr, results, oom_killed, int(last["stepped"]),
            bytes(self._late[child.stderr]), self._hidden_sent, talked,
        )  # fmt: skip

    def _talk(self) -> Any:
        """Talk with the driver, if the job asks for it; see grader.sandbox.talking."""
        return None

    def _serve(self) -> bool:
        """Check the limits, wait once for the child, and serve its pipes; return True when it is dead."""
        # Not at every message of the child: a check reads several files of /proc.
        if self._cause is None and time.monotonic() >= self._check_at:
            self._check_limits()
            self._check_at = time.monotonic() + self._patience()
        if self._cause is not None and self._killed_at is None:
            self._child.kill()
            self._killed_at = time.monotonic()
        if self._killed_at is not None and time.monotonic() > self._killed_at + DEATH_S_MAX:
            raise JailFault("A child of the jail does not die.")
        for key, _ in self._selector.select(self._time_to_check()):
            if key.fd == self._child.pidfd:
                return True
            if key.fd == self._child.job:
                self._feed()
            elif key.fd == self._child.status.fileno():
                self._read_keeper()
            else:
                self._take(key.fd)
        return False

    def _time_to_check(self) -> float:
        """Return the time until the next check of the limits [s]."""
        return 1.0 if self._cause is not None else max(0.0, self._check_at - time.monotonic())

    def _patience(self) -> float:
        """Return the time from one check of the limits to the next [s]: none can be passed by more than it, as CPU time
        may pass faster by the number of cores."""
        wall_left = self._limits.wall_s + self._aside_s - self._usage.waited_s
        cpu_left = self._limits.cpu_s - self._usage.cpu_s
        return max(POLL_S_MIN, min(POLL_S_MAX, wall_left, cpu_left / CORES))

    def _check_limits(self) -> None:
        usage, limits = self._usage, self._limits
        usage.refresh()
        if usage.cpu_s >= limits.cpu_s:
            self._cause = Cause.CPU
        elif usage.waited_s >= limits.wall_s + self._aside_s:
            self._cause = Cause.WALL
        elif usage.private_bytes > limits.memory_mb * MB + RESIDENT_EXTRA:
            self._cause = Cause.MEMORY
        elif self._is_stopped():
            self._cause = Cause.STOP

    def _feed(self) -> None:
        try:
            self._unsent = self._unsent[os.write(self._child.job, self._unsent) :]
        except BlockingIOError:
            return
        except BrokenPipeError:
            self._unsent = self._unsent[:0]
        if not self._unsent:
            self._selector.unregister(self._child.job)
            if self._is_whole():
                self._child.hang_up()
            sent, self._sent = self._sent, ignore
            sent()

    def _is_whole(self) -> bool:
        """Whether there is nothing more to send than what is unsent."""
        return not self._withheld

    def _send_next(self) -> None:
        """Send the next part that was withheld."""
        if self._withheld and self._child.job >= 0:
            self._send(self._withheld.pop(0)())

    def _send(self, part: bytes) -> None:
        self._unsent = memoryview(bytes(self._unsent) + frame_part(part))
        if self._child.job not in self._selector.get_map():
            self._selector.register(self._child.job, selectors.EVENT_WRITE)

    def _answer(self) -> None:
        """Answer the requests that have arrived: the first with the inputs, the second with the hidden inputs. Both may
        arrive at once; neither is answered while the integrators are still there."""
        wants = min(self._wants.scan(self._read[self._child.results]), WANTS_MAX)
        while self._answered < wants and not self._removing:
            self._answered += 1
            if self._answered == 1 and self._without_integrators:
                self._removing = True
                self._child.ask_for_removal()
                continue
            if self._answered == WANTS_MAX:
                for descriptor in self._late:
                    while self._take(descriptor):
                        pass
                self._hidden_sent = True
            self._send_next()

    def _read_keeper(self) -> None:
        """Read a message of the keeper: the integrators are removed, or the child has died."""
        message = self._child.status.recv(READ_BYTES)
        if message == b"removed":
            self._removing = False
            self._send_next()
            self._answer()
        else:
            self._last = message
            self._selector.unregister(self._child.status.fileno())

    def _take(self, descriptor: int) -> bool:
        """Read once; return True if there may be more."""
        buffer, (cap, cause) = self._read[descriptor], self._caps[descriptor]
        try:
            chunk = os.read(descriptor, READ_BYTES)
        except BlockingIOError:
            return False
        if not chunk:
            if descriptor in self._selector.get_map():
                self._selector.unregister(descriptor)
            return False
        late = self._late.get(descriptor) if self._hidden_sent else None
        room = cap - len(buffer) - (len(late) if late is not None else 0)
        target = buffer if late is None else late
        target += chunk[:room]
        if len(chunk) > room and self._cause is None:
            self._cause = cause
        if descriptor == self._child.results:
            self._answer()
        return len(chunk) <= room

    def _drain(self) -> None:
        """Read what is left in the pipes of the dead child, up to each cap."""
        for descriptor in self._read:
            while self._take(descriptor):
                pass

    def _final_report(self) -> dict[str, Any]:
        """Return the last message of the keeper, which is trusted: it never ran a student's code."""
        try:
            self._child.status.settimeout(DEATH_S_MAX)
            last: dict[str, Any] = json.loads(self._last or self._child.status.recv(READ_BYTES))
            if last.keys() >= {"ended", "cpu_s", "stepped"}:
                return last
        except (OSError, ValueError, AttributeError) as error:
            raise JailFault("The jail was lost while a script ran.") from error
        raise JailFault("The jail was lost while a script ran.")
