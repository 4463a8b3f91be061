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
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from functools import cache, partial
from http.client import HTTPConnection
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from grader.bench.answers import backends, beside_bare
from grader.bench.jail import overheads
from grader.bench.picture import new_figure
from grader.bench.study import Do, Key, Record, Records, Study, Task
from grader.settings import Settings

GRADER = Path(sys.executable).parent / "grader"
STUDENTS = 4
START_S = 120.0
GRADED_S = 60.0
POLL_S = 0.01
UNLIMITED = {"GRADER_RATE_PER_S": "100000", "GRADER_RATE_BURST": "100000"}

SCRIPT = "def largest_stable_timestep(model, integrator):\n    return None\n"
"""Costs the jail a whole run and the grader a whole certificate, whatever the verdict."""

JUDGED = (
    "servo-threshold/correct__the_lessons_script_and_a_bisection.py",
    "rk4-step/correct__classical.py",
    "rk4-free-joint/correct__quaternion_derivative.py",
)
"""Right answers; the last is judged by its convergence, which costs most."""


@dataclass(frozen=True)
class Load(Key):
    """`answers` (typed numbers) or `scripts`, submitted by so many students at once."""

    load: str
    students: int


@dataclass(frozen=True)
class Beside(Key):
    """Choice answers beside a bare route with one durable insert, by so many students at once."""

    backend: str
    students: int


@dataclass(frozen=True)
class Judging(Key):
    """Our own simulating for one exercise, without the script's run."""

    exercise: str


@dataclass(frozen=True)
class Overhead(Key):
    """The jail's cost above the script's own time, and what it is compared with."""


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

    def answer(self) -> None:
        """Submit a typed number and check its verdict."""
        status, body = self.request("POST", "/submissions", {"quiz": "1.3-check", "question": "q2", "answer": "5 ms"})
        require(status == 201 and body["verdict"]["status"] == "correct", body)

    def script(self) -> None:
        """Submit a script and wait until its verdict can be fetched."""
        self.graded("servo-threshold", SCRIPT)

    def graded(self, question: str, source: str) -> dict[str, Any]:
        """The verdict on a script of the exercises. Raises TimeoutError after GRADED_S."""
        end = time.perf_counter() + GRADED_S
        body = {"quiz": "1.3-exercises", "question": question, "answer": {"source": source}}
        status, submission = self.request("POST", "/submissions", body)
        require(status == 202, submission)
        while time.perf_counter() < end:
            _, found = self.request("GET", f"/submissions/{submission['id']}")
            if found["status"] in ("graded", "needs_review"):
                require(found["verdict"]["status"] != "grader_fault", found)
                verdict: dict[str, Any] = found["verdict"]
                return verdict
            time.sleep(POLL_S)
        raise TimeoutError("a script was not graded in time")


def require(held: bool, body: Any) -> None:
    """Raise RuntimeError for an unexpected answer: its time would say nothing."""
    if not held:
        raise RuntimeError(f"the service answered {body}")


@contextmanager
def server(students: int) -> Iterator[list[Client]]:
    """`grader serve` on a free port with fresh data, and a client for each student."""
    with TemporaryDirectory() as folder:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = int(free.getsockname()[1])
        arguments = [str(GRADER), "serve", "--port", str(port), "--data", folder]
        process = subprocess.Popen(  # noqa: S603  our own command
            arguments, env=os.environ | UNLIMITED, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        try:
            wait_until_ready(process, port)
            yield [Client(port, token_of(folder, f"student{number}")) for number in range(students)]
        finally:
            process.terminate()
            process.wait(timeout=30)


def wait_until_ready(process: "subprocess.Popen[bytes]", port: int) -> None:
    """Return once /readyz answers 200. Raises RuntimeError where the server ended or took too long."""
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


def load(clients: Clients, submit: Callable[[Client], None], students: int, each: int) -> Record:
    """`students` at once submit `each` times one after the other; wall times from request to verdict [s]."""

    def time_all(client: Client) -> list[float]:
        stamps = [time.perf_counter()]
        for _ in range(each):
            submit(client)
            stamps.append(time.perf_counter())
        return np.diff(stamps).tolist()

    busy = clients()[:students]
    submit(busy[0])
    with ThreadPoolExecutor(students) as pool:
        begin = time.perf_counter()
        times = [one for several in pool.map(time_all, busy) for one in several]
        per_second = len(times) / (time.perf_counter() - begin)
    return {"submissions": len(times), "per_second": per_second} | percentiles(times)


def judging(clients: Clients, program: Path, count: int) -> Record:
    """The CPU time of our own simulating [s]; every submission draws its cases anew."""
    source = program.read_text(encoding="utf-8")
    verdicts = [clients()[0].graded(program.parent.name, f"{source}\n# {number}\n") for number in range(count)]
    return {"submissions": count} | percentiles([verdict["timing_ms"]["judge_cpu"] / 1000 for verdict in verdicts])


def overhead(quick: bool) -> Record:
    """Wall times of the jail [s] and of what it is compared with, and the rate of bursts [jobs/s]."""
    times, per_second = overheads(Settings().content / "models", *((10, 1) if quick else (40, 3)))
    return {"per_second": per_second, "runs": [{"run": name} | percentiles(one) for name, one in times.items()]}


def percentiles(times_s: list[float]) -> Record:
    """Median and 95th percentile."""
    middle, late = np.percentile(times_s, [50, 95])
    return {"median_s": float(middle), "p95_s": float(late)}


def measure(quick: bool, do: Do) -> Records:
    """Typed numbers and scripts, by one student and by four at once, and what judging costs alone.

    One server serves all, and is started only if something is left to measure.
    """
    answers, scripts = (25, 3) if quick else (200, 15)
    programs = [Settings().content / "reference_solutions/1.3-exercises" / program for program in JUDGED]
    with ExitStack() as stack:

        @cache
        def clients() -> list[Client]:
            return stack.enter_context(server(STUDENTS))

        rounds, seconds = (1, 1.0) if quick else (5, 5.0)
        tasks = [Task(Overhead(), partial(overhead, quick))]
        tasks += [
            Task(Beside(backend, students), partial(beside_bare, backend, students, rounds, seconds))
            for backend in backends()
            for students in (10, 50)
        ]
        for students in (1, STUDENTS):
            tasks += [
                Task(Load("answers", students), partial(load, clients, Client.answer, students, answers)),
                Task(Load("scripts", students), partial(load, clients, Client.script, students, scripts)),
            ]
        tasks += [Task(Judging(path.parent.name), partial(judging, clients, path, scripts)) for path in programs]
        return do(tasks)


def summarise(records: Records) -> Record:
    """The records, as rows."""
    return {"loads": [key.row() | row for key, record in records.items() for row in rows(key, record)]}


def rows(_key: Key, record: Record) -> list[Record]:
    """One row a load; for the jail, one a kind of run."""
    return [run | {"per_second": record["per_second"]} for run in record["runs"]] if "runs" in record else [record]


def draw(records: Records, _summary: Record) -> dict[str, Figure]:
    """Median and 95th percentile of each load."""
    figure = new_figure(7, 4)
    axes = figure.subplots()
    bars = [(label_of(key, row), row) for key, record in records.items() for row in rows(key, record)]
    for place, (label, row) in enumerate(bars):
        axes.barh(place, 1e3 * row["p95_s"], color="#bbccee", height=0.6)
        axes.barh(place, 1e3 * row["median_s"], color="#335599", height=0.6)
        axes.text(1e3 * row["p95_s"], place, f" {label}", va="center", fontsize=8)
    axes.set_yticks([])
    axes.set_xlim(0, 2.2e3 * max(row["p95_s"] for _, row in bars))
    axes.set_xlabel("ms until the verdict is back: median (dark) and 95th percentile (light)")
    return {"service": figure}


def label_of(key: Key, row: Record) -> str:
    """What a bar shows."""
    if isinstance(key, Load):
        return f"{key.load}, {key.students} at once: {row['per_second']:.0f} a second"
    if isinstance(key, Beside):
        return f"choices on {key.backend}, {key.students} at once: {row['ratio']:.2f} of a bare route"
    return f"judging {key.exercise}, our own CPU time" if isinstance(key, Judging) else str(row["run"])


STUDY = Study("service", measure, summarise, rows, draw)
