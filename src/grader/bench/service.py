"""Latency and throughput of submissions: the real server, its jail and its database, over HTTP.

Wall time, unlike in the other benchmarks: a student waits in wall time. The server is a process of its own on a
database of its own, with rate limits lifted.
"""

import json
import os
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from http.client import HTTPConnection
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from grader.bench.journal import Record, Task
from grader.settings import Settings

GRADER = Path(sys.executable).parent / "grader"
STUDENTS = 4
START_S = 120.0
GRADED_S = 60.0
POLL_S = 0.01
UNLIMITED = {"GRADER_RATE_PER_S": "100000", "GRADER_RATE_BURST": "100000"}

SCRIPT = """\
def largest_stable_timestep(model, integrator):
    return None
"""
"""Costs the jail a whole run and the grader a whole certificate, whatever the verdict."""


JUDGED = (
    "servo-threshold/correct__the_lessons_script_and_a_bisection.py",
    "rk4-step/correct__classical.py",
    "rk4-free-joint/correct__quaternion_derivative.py",
)
"""Right answers; the last is judged by its convergence, which costs most."""


class Client:
    """One student with one connection."""

    def __init__(self, port: int, token: str) -> None:
        self.connection = HTTPConnection("127.0.0.1", port, timeout=GRADED_S)
        self.headers = {"Authorization": f"Bearer {token}", "Content-Type": "application/json"}

    def request(self, method: str, path: str, body: Any = None) -> tuple[int, Any]:
        """Status and JSON of a call under /api/v1."""
        self.connection.request(method, f"/api/v1{path}", json.dumps(body) if body else None, self.headers)
        answer = self.connection.getresponse()
        return answer.status, json.loads(answer.read())

    def answer_s(self) -> float:
        """How long a typed number takes until its verdict is back [s]."""
        begin = time.perf_counter()
        status, body = self.request("POST", "/submissions", {"quiz": "1.3-check", "question": "q2", "answer": "5 ms"})
        expect(status == 201 and body["verdict"]["status"] == "correct", body)
        return time.perf_counter() - begin

    def script_s(self) -> float:
        """How long a script takes from the request until its verdict can be fetched [s]."""
        begin = time.perf_counter()
        self.graded("servo-threshold", SCRIPT)
        return time.perf_counter() - begin

    def graded(self, question: str, source: str) -> dict[str, Any]:
        """The verdict on a script of the exercises, once it is there."""
        end = time.perf_counter() + GRADED_S
        body = {"quiz": "1.3-exercises", "question": question, "answer": {"source": source}}
        status, submission = self.request("POST", "/submissions", body)
        expect(status == 202, submission)
        while time.perf_counter() < end:
            _, found = self.request("GET", f"/submissions/{submission['id']}")
            if found["status"] in ("graded", "needs_review"):
                expect(found["verdict"]["status"] != "grader_fault", found)
                verdict: dict[str, Any] = found["verdict"]
                return verdict
            time.sleep(POLL_S)
        raise TimeoutError("a script was not graded in time")


def expect(held: bool, body: Any) -> None:
    """A benchmark of wrong answers would measure nothing."""
    if not held:
        raise RuntimeError(f"the service answered {body}")


@contextmanager
def server(students: int) -> Iterator[list[Client]]:
    """`grader serve` on a free port with fresh data, and a client for each student."""
    with TemporaryDirectory() as folder:
        environment = os.environ | UNLIMITED
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = int(free.getsockname()[1])
        arguments = [str(GRADER), "serve", "--port", str(port), "--data", folder]
        process = subprocess.Popen(  # noqa: S603  our own command
            arguments, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        try:
            wait_until_ready(process, port)
            yield [Client(port, token_of(folder, f"student{number}")) for number in range(students)]
        finally:
            process.terminate()
            process.wait(timeout=30)


def wait_until_ready(process: "subprocess.Popen[bytes]", port: int) -> None:
    """Until /readyz says so; RuntimeError where the server ended or took too long."""
    end = time.perf_counter() + START_S
    while time.perf_counter() < end and process.poll() is None:
        with suppress(OSError):
            connection = HTTPConnection("127.0.0.1", port, timeout=5)
            connection.request("GET", "/readyz")
            if connection.getresponse().status == 200:
                return
        time.sleep(0.1)
    raise RuntimeError("the server did not become ready")


def token_of(folder: str, user: str) -> str:
    """A student's token."""
    arguments = [str(GRADER), "token", "create", "--user", user, "--role", "student", "--data", folder]
    done = subprocess.run(arguments, capture_output=True, text=True, check=True)  # noqa: S603  our own command
    return str(done.stdout).strip()


Clients = Callable[[], list[Client]]


def load_task(name: str, students: int, each: int, one: Callable[[Client], float], clients: Clients) -> Task:
    """`students` at once, `each` submissions one after the other."""

    def measure() -> Record:
        busy = clients()[:students]
        one(busy[0])
        with ThreadPoolExecutor(students) as pool:
            begin = time.perf_counter()
            rounds = pool.map(lambda client: [one(client) for _ in range(each)], busy)
            times = np.concatenate(list(rounds))
            spent = time.perf_counter() - begin
        middle, late = np.percentile(times, [50, 95])
        return {
            "students": students,
            "submissions": len(times),
            "per_second": len(times) / spent,
            "median_s": float(middle),
            "p95_s": float(late),
        }

    return Task(f"{name}/{students}", measure)


def judging_task(program: Path, count: int, clients: Clients) -> Task:
    """The CPU time of our own simulating, without the script's run; every submission draws its cases anew."""
    question = program.parent.name

    def measure() -> Record:
        source = program.read_text(encoding="utf-8")
        verdicts = [clients()[0].graded(question, f"{source}\n# {number}\n") for number in range(count)]
        times = [verdict["timing_ms"]["judge_cpu"] / 1000 for verdict in verdicts]
        middle, late = np.percentile(times, [50, 95])
        return {"submissions": count, "median_s": float(middle), "p95_s": float(late)}

    return Task(f"judging {question}/1", measure)


def service_tasks(quick: bool, clients: Clients) -> list[Task]:
    """Typed numbers and scripts, by one student and by four at once, and what judging costs alone.

    `clients` starts the server when first called.
    """
    answers, scripts = (25, 3) if quick else (200, 15)
    loads = [
        load_task(name, students, each, one, clients)
        for students in (1, STUDENTS)
        for name, each, one in (("answers", answers, Client.answer_s), ("scripts", scripts, Client.script_s))
    ]
    programs = (Settings().content / "reference_solutions/1.3-exercises" / program for program in JUDGED)
    return loads + [judging_task(program, scripts, clients) for program in programs]
