"""A busy core changes no verdict: three processes spin beside the jail in every test here.

They and the jail share one core, since a busy machine would only make the other tests slow.
"""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import pytest

from grader.domain.run import Job, Limits, RunReport, RunStatus
from grader.errors import JailFault
from grader.sandbox.jail import Jail
from grader.sandbox.report import build_report
from grader.sandbox.watch import Cause, Ending

DRIVER = "def run(student, inputs, submit):\n    submit('value', student.main())\n"
SPINNERS = 3
TIMES = 4
THREADS = """
import threading

def spin():
    while True:
        pass

for _ in range(4):
    threading.Thread(target=spin).start()
"""
ENDLESS = {
    "after its main thread has ended": THREADS
    + "import ctypes\nctypes.CDLL(None).syscall({'x86_64': 60}.get(__import__('platform').machine(), 93), 0)",
    "in C": "sum(iter(int, 1))",
    "in threads": THREADS + "spin()",
}
WORKS = """
import time

def main():
    while time.process_time() < {cpu_s}:
        pass
    return [1.0]
"""
WORKS_IN_THREADS = """
import threading, time

def work():
    while time.process_time() < {cpu_s}:
        pass

def main():
    workers = [threading.Thread(target=work) for _ in range(3)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    return [1.0]
"""


@pytest.fixture(scope="module", autouse=True)
def spinners() -> Iterator[None]:
    cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(cores)})  # what is started from now on inherits it
    processes = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(SPINNERS)]
    yield
    for process in processes:
        process.kill()
        process.wait()
    os.sched_setaffinity(0, cores)


def several(jail: Jail, source: str, limits: Limits, times: int = TIMES) -> list[RunReport]:
    with ThreadPoolExecutor(2) as pool:
        return list(pool.map(jail.run, [Job(source, DRIVER, {}, limits)] * times))


@pytest.mark.parametrize("source", ENDLESS.values(), ids=ENDLESS)
def test_an_endless_program_is_timed_out_every_time(source: str, jail: Jail) -> None:
    reports = several(jail, source, Limits(cpu_s=0.2, wall_s=1))
    assert [report.status for report in reports] == [RunStatus.TIMED_OUT] * TIMES
    assert all(report.reason.startswith("The script used up its CPU time of 0.2 s.") for report in reports)
    assert all(report.cpu_s >= 0.2 for report in reports)


@pytest.mark.parametrize("source", [WORKS, WORKS_IN_THREADS], ids=["one thread", "threads"])
def test_a_program_that_uses_most_of_its_limit_returns_every_time(source: str, jail: Jail) -> None:
    """The wall limit is shorter than the work takes here: time without a core does not count."""
    reports = several(jail, source.format(cpu_s=0.95), Limits(cpu_s=1, wall_s=1), times=2)
    assert [report.status for report in reports] == [RunStatus.RETURNED] * 2, reports
    assert all(0.9 < report.cpu_s < 1 for report in reports)


def test_the_kernels_own_limit_is_well_above_the_jobs(jail: Jail) -> None:
    source = "import resource\ndef main():\n    return list(resource.getrlimit(resource.RLIMIT_CPU))\n"
    report = jail.run(Job(source, DRIVER, {}, Limits(cpu_s=10)))
    assert report.results["value"].min() >= 20


def ending(cause: Cause | None = None, cpu_s: float = 1.0, oom_killed: bool = False) -> Ending:
    return Ending(cause, int(signal.SIGKILL), cpu_s, 5.0, b"", b"", b"", oom_killed)


@pytest.mark.parametrize(
    ("seen", "status"),
    [
        (ending(cpu_s=9.5), RunStatus.TIMED_OUT),  # RLIMIT_CPU counts ticks, and may be early
        (ending(cpu_s=12.0), RunStatus.TIMED_OUT),
        (ending(Cause.WALL), RunStatus.TIMED_OUT),
        (ending(Cause.MEMORY), RunStatus.OUT_OF_MEMORY),
        (ending(oom_killed=True), RunStatus.OUT_OF_MEMORY),
        (ending(Cause.CPU, oom_killed=True), RunStatus.OUT_OF_MEMORY),
    ],
)
def test_who_killed_it_decides(seen: Ending, status: RunStatus) -> None:
    assert build_report(seen, Job("", "", {}, Limits(cpu_s=10))).status is status


def test_a_kill_that_nothing_explains_is_a_fault_of_ours() -> None:
    with pytest.raises(JailFault, match="killed from outside"):
        build_report(ending(cpu_s=1.0), Job("", "", {}, Limits(cpu_s=10)))
