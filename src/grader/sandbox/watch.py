"""One run, watched from outside: its pipes, its CPU and wall clocks, and the kill when a limit is reached."""

import json
import os
import selectors
import struct
import time
from dataclasses import dataclass
from enum import StrEnum

from grader.domain.run import Limits
from grader.errors import JailFault
from grader.sandbox.attest import proc
from grader.sandbox.child import Child
from grader.sandbox.policy import KB, RESULT_BYTES_MAX

READ_BYTES = 1 << 16
POLL_S_MIN = 0.005
DEATH_S_MAX = 20.0
CLOCK_PROF_OF_PROCESS = 2  # CPUCLOCK_SCHED; the clock's number is made from the pid, see clock_getcpuclockid(3)


class Cause(StrEnum):
    """Why we ended it."""

    CPU = "cpu"
    WALL = "wall"
    OUTPUT = "output"
    RESULTS = "results"


@dataclass(frozen=True)
class Ending:
    """How a run ended, by what was seen from outside; the three streams are the script's own words."""

    cause: Cause | None
    wait_status: int
    cpu_s: float
    wall_s: float
    stdout: bytes
    stderr: bytes
    results: bytes
    oom_killed: bool = False


class Watch:
    """Feeds one job to a child and stays until the child is dead."""

    def __init__(self, child: Child, limits: Limits, job: bytes) -> None:
        self._child, self._limits = child, limits
        self._unsent = memoryview(struct.pack("<I", len(job)) + job)
        self._read = {child.stdout: bytearray(), child.stderr: bytearray(), child.results: bytearray()}
        self._caps = {
            child.stdout: (limits.output_kb * KB, Cause.OUTPUT),
            child.stderr: (limits.output_kb * KB, Cause.OUTPUT),
            child.results: (RESULT_BYTES_MAX, Cause.RESULTS),
        }
        self._cause: Cause | None = None
        self._selector = selectors.PollSelector()

    def run(self) -> Ending:
        """Block until the child is gone and everything it wrote is read.

        Raises:
            JailFault: it cannot be killed, or the keeper that must tell how it ended is gone.
        """
        child = self._child
        self._cpu_before, self._busy_before, self._began = _cpu_s(child.pid), _busy_s(child.pid), time.monotonic()
        for descriptor in self._read:
            self._selector.register(descriptor, selectors.EVENT_READ)
        self._selector.register(child.job, selectors.EVENT_WRITE)
        self._selector.register(child.pidfd, selectors.EVENT_READ)
        with self._selector:
            self._until_dead()
            self._drain()
        wall_s = time.monotonic() - self._began
        wait_status, cpu_s = self._last_word()
        stdout, stderr, results = (bytes(buffer) for buffer in self._read.values())
        oom_killed = child.group is not None and child.group.ran_out()
        return Ending(
            self._cause, wait_status, max(0.0, cpu_s - self._cpu_before), wall_s, stdout, stderr, results, oom_killed
        )

    def _until_dead(self) -> None:
        killed_at: float | None = None
        while True:
            if self._cause is None:
                self._check_clocks()
            if self._cause is not None and killed_at is None:
                self._child.kill()
                killed_at = time.monotonic()
            if killed_at is not None and time.monotonic() > killed_at + DEATH_S_MAX:
                raise JailFault("A child of the jail does not die.")
            for key, _ in self._selector.select(self._patience()):
                descriptor = int(key.fd)
                if descriptor == self._child.pidfd:
                    return
                if descriptor == self._child.job:
                    self._feed()
                else:
                    self._take(descriptor)

    def _patience(self) -> float:
        """How long no limit can be reached: with every core at work, CPU time runs that much faster than the clock."""
        if self._cause is not None:
            return 1.0
        wall_left = self._limits.wall_s - self._waited_s()
        cpu_left = self._limits.cpu_s - (_cpu_s(self._child.pid) - self._cpu_before)
        return max(POLL_S_MIN, min(wall_left, cpu_left / (os.cpu_count() or 1)))

    def _check_clocks(self) -> None:
        if _cpu_s(self._child.pid) - self._cpu_before >= self._limits.cpu_s:
            self._cause = Cause.CPU
        elif self._waited_s() >= self._limits.wall_s:
            self._cause = Cause.WALL

    def _waited_s(self) -> float:
        """How long the script neither worked nor wanted to [s]. What a hypervisor takes away looks the same."""
        return time.monotonic() - self._began - (_busy_s(self._child.pid) - self._busy_before)

    def _feed(self) -> None:
        try:
            self._unsent = self._unsent[os.write(self._child.job, self._unsent) :]
        except BlockingIOError:
            return
        except BrokenPipeError:
            self._unsent = self._unsent[:0]
        if not self._unsent:
            self._selector.unregister(self._child.job)
            self._child.hang_up()

    def _take(self, descriptor: int) -> bool:
        """Read once; True when there may be more."""
        buffer, (cap, cause) = self._read[descriptor], self._caps[descriptor]
        try:
            chunk = os.read(descriptor, READ_BYTES)
        except BlockingIOError:
            return False
        if not chunk:
            if descriptor in self._selector.get_map():
                self._selector.unregister(descriptor)
            return False
        room = cap - len(buffer)
        buffer += chunk[:room]
        if len(chunk) > room and self._cause is None:
            self._cause = cause
        return len(chunk) <= room

    def _drain(self) -> None:
        """What is still in the pipes of the dead; a flood stops at its cap."""
        for descriptor in self._read:
            while self._take(descriptor):
                pass

    def _last_word(self) -> tuple[int, float]:
        """Wait status and CPU time, from the keeper in the cell that never ran a student's code."""
        try:
            self._child.status.settimeout(DEATH_S_MAX)
            wait_status, cpu_s, _ = json.loads(self._child.status.recv(READ_BYTES))
        except (OSError, ValueError, TypeError) as error:
            raise JailFault("The jail was lost while a script ran.") from error
        return int(wait_status), float(cpu_s)


def _cpu_s(pid: int) -> float:
    """CPU time of all threads of a process [s]; 0 when it is gone."""
    try:
        return time.clock_gettime((~pid << 3) | CLOCK_PROF_OF_PROCESS)
    except OSError:
        return 0.0


def _busy_s(pid: int) -> float:
    """How long its main thread was at work, or ready to work and had no core [s]: the machine's time, not its own."""
    try:
        return sum(map(int, proc(f"{pid}/schedstat").split()[:2])) / 1e9
    except OSError:
        return 0.0
