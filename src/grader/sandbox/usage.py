"""Measures a running child from outside: CPU time, waiting time, memory. A child is one process (the filter refuses
others), but its main thread may end before the rest. So CPU time comes from the clock of the whole process, which
counts threads that have ended, and everything else from its living threads."""

import os
import time
from dataclasses import dataclass

from grader.sandbox.locks.attest import read_proc

CLOCK_OF_PROCESS = 2  # CPUCLOCK_SCHED; the clock's number is made from the pid, see clock_getcpuclockid(3)
PAGE_BYTES = os.sysconf("SC_PAGE_SIZE")


@dataclass(frozen=True)
class Thread:
    """One living thread: time in which it worked or waited for a core [s], and the private memory of its process."""

    wanted_s: float
    private_bytes: int


class Usage:
    """The use of a process since this object was made; `refresh` reads it again."""

    def __init__(self, pid: int) -> None:
        self._pid = pid
        self.cpu_s, self.waited_s, self.private_bytes = 0.0, 0.0, 0
        self._began = self._at = time.monotonic()
        self.cpu_before_s = read_cpu_clock_s(pid) or 0.0
        self._wanted = {tid: thread.wanted_s for tid, thread in list_threads(pid).items()}

    def refresh(self) -> None:
        """Read the clocks. Time in which a thread worked, or was ready but had no core, does not count as waiting. Time
        that a hypervisor takes away does: it cannot be distinguished."""
        now = time.monotonic()
        clock_s = read_cpu_clock_s(self._pid)
        if clock_s is None:  # it has ended
            return
        living = list_threads(self._pid)
        passed_s, worked_s = now - self._at, clock_s - self.cpu_before_s - self.cpu_s
        wanted_s = [thread.wanted_s - self._wanted.get(tid, 0.0) for tid, thread in living.items()]
        self.waited_s += passed_s - max(min(worked_s, passed_s), *wanted_s, 0.0)
        self._at, self.cpu_s = now, clock_s - self.cpu_before_s
        self._wanted = {tid: thread.wanted_s for tid, thread in living.items()}
        self.private_bytes = max((thread.private_bytes for thread in living.values()), default=0)

    @property
    def wall_s(self) -> float:
        """Time since the beginning [s]."""
        return time.monotonic() - self._began


def read_cpu_clock_s(pid: int) -> float | None:
    """CPU time of a process [s], all its threads, living and ended; None when it is gone."""
    try:
        return time.clock_gettime((~pid << 3) | CLOCK_OF_PROCESS)
    except OSError:
        return None


def list_threads(pid: int) -> dict[int, Thread]:
    """Returns the living threads of a process."""
    threads = {}
    try:
        for name in os.listdir(f"/proc/{pid}/task"):  # noqa: PTH208
            try:
                wanted_ns = sum(map(int, read_proc(f"{pid}/task/{name}/schedstat").split()[:2]))
                resident, shared = map(int, read_proc(f"{pid}/task/{name}/statm").split()[1:3])
            except (OSError, ValueError):
                continue  # it has ended since
            threads[int(name)] = Thread(wanted_ns / 1e9, (resident - shared) * PAGE_BYTES)
    except OSError:
        pass
    return threads


def count_oom_kills() -> int:
    """How many processes the kernel has ended on this machine because memory ran out."""
    rows = read_proc("vmstat").splitlines()
    return next((int(row.split()[1]) for row in rows if row.startswith("oom_kill ")), 0)
