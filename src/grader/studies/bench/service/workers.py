"""A queue of scripts, worked off by more and more grading processes of the real server."""

import os
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from itertools import count
from pathlib import Path

import numpy as np

from grader.studies.bench.service.submitting import SCRIPT, Client, read_right_answer, serve_clients
from grader.studies.bench.study import Measurement, Record, Records

LONG = """
import time

def largest_stable_timestep(model, integrator):
    until = time.process_time() + 0.1
    while time.process_time() < until:
        pass
"""
"""Computes for a tenth of a second in each of some twenty calls."""

SCRIPTS: dict[str, Callable[[], tuple[str, int]]] = {
    "empty": lambda: (SCRIPT, 60),
    "reference": lambda: (read_right_answer("servo-threshold"), 32),
    "long": lambda: (LONG, 4),
}
"""What the scripts of a burst hold, and how many of them are queued."""

WORKER_COUNTS = (1, 2, 4)
NUMBERS = count()
"""Makes every script differ from all others."""


@dataclass(frozen=True)
class Workers(Measurement):
    """A queue of scripts, worked off by one, two and four grading processes.

    Nothing is handed in or asked for meanwhile. `cores` is how many cores the service keeps busy, its server, grading
    processes and jails together: the service prepares the verdict while the script runs, and the next cell while the
    verdict is stored. Where one grading process keeps more than one core busy that way, two of them gain less than
    twice on two cores.
    """

    script: str

    def measure(self, quick: bool, done: Records) -> Record:
        """Rates by the number of processes [1/s], their ratios to one, busy cores: medians of bursts in turn."""
        source, queued = SCRIPTS[self.script]()
        each, rounds = (max(WORKER_COUNTS), 1) if quick else (queued, 5)
        with ExitStack() as stack:
            busy = {n: stack.enter_context(serve_clients(1, GRADER_WORKERS=str(n)))[0] for n in WORKER_COUNTS}
            for client in busy.values():
                measure_queue(client, SCRIPT, each if quick else 8)
            bursts = [{n: measure_queue(client, source, each) for n, client in busy.items()} for _ in range(rounds)]
        runs = []
        for n in WORKER_COUNTS:
            rates, costs = zip(*(burst[n] for burst in bursts), strict=True)
            ratios = [burst[n][0] / burst[1][0] for burst in bursts]
            measured = {"per_second": rates, "ratio": ratios, "cores": np.multiply(rates, costs), "cpu_s": costs}
            runs.append({"workers": n} | {name: float(np.median(values)) for name, values in measured.items()})
        return {"machine_cores": os.cpu_count() or 1, "runs": runs}

    def rows(self, record: Record) -> list[Record]:
        """Returns one row a number of processes."""
        return [{"machine_cores": record["machine_cores"], **run} for run in record["runs"]]


def measure_queue(client: Client, source: str, scripts: int) -> tuple[float, float]:
    """The rate at which queued scripts are graded [1/s], and the CPU time of one in all processes of the service [s].
    The grading processes are held until all are handed in; at most 100 scripts."""
    client.connection.close()  # and a new one: a server closes those that are idle
    sources = (f"{source}# {next(NUMBERS)}\n" for _ in range(scripts))  # each draws other cases
    with hold_processes(client.server):
        ids = [client.hand_in("servo-threshold", source) for source in sources]
        began, before_s = time.perf_counter(), read_family_cpu_s(client.server)
    for id_ in ids[-max(WORKER_COUNTS) :]:  # one of them is the last
        client.watch_submission(id_)
    ended, after_s = time.perf_counter(), read_family_cpu_s(client.server)
    return scripts / (ended - began), (after_s - before_s) / scripts


@contextmanager
def hold_processes(server: int) -> Iterator[None]:
    """Stops the grading processes of a server for the block."""
    pids = [pid for pid, stat in list_processes().items() if int(stat[1]) == server and is_grading(pid)]
    for pid in pids:
        os.kill(pid, signal.SIGSTOP)
    try:
        yield
    finally:
        for pid in pids:
            os.kill(pid, signal.SIGCONT)


def is_grading(pid: int) -> bool:
    """Whether this is a grading process."""
    with suppress(OSError):  # it has ended
        return "grading.process_main" in Path(f"/proc/{pid}/cmdline").read_text()
    return False


def read_family_cpu_s(pid: int) -> float:
    """Returns the CPU time of a process and its descendants [s], with those that have ended and were waited for."""
    return sum(sum(map(int, stat[11:15])) for stat in list_family(pid).values()) / os.sysconf("SC_CLK_TCK")


def list_family(pid: int) -> dict[int, list[str]]:
    """Returns a process and its descendants, as `list_processes` does."""
    stats, family = list_processes(), {pid}
    while more := {child for child, stat in stats.items() if int(stat[1]) in family} - family:
        family |= more
    return {member: stats[member] for member in family & stats.keys()}


def list_processes() -> dict[int, list[str]]:
    """The fields after the name in /proc/PID/stat of every process: 1 is its parent, 11 to 14 are CPU times [ticks]."""
    processes = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):  # it has ended
            processes[int(stat.parent.name)] = stat.read_text().rpartition(")")[2].split()
    return processes
