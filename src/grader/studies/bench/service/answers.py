"""Instant answers beside two bare routes of FastAPI (`bare.py`): three servers in turn, in one run.

A class hands in what a class does (`classroom.py`). On each connection learners take turns, so that none makes hundreds
of attempts, which the service counts with every answer. CPU times are those of the server process alone: PostgreSQL has
processes of its own, and SQLite has none.
"""

import os
import secrets
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path
from random import Random
from statistics import median
from tempfile import TemporaryDirectory

import numpy as np
import psycopg
from sqlalchemy.engine import make_url

from grader.courses.people.tokens import create_token
from grader.store.engine.database import Database
from grader.studies.bench.service.classroom import QUIZ, make_answers, write_class
from grader.studies.bench.service.sending import Client, build_request, send_together
from grader.studies.bench.study import Record

POSTGRES = os.environ.get("GRADER_TEST_POSTGRES", "postgresql://postgres@127.0.0.1:5432/test")
START_S = 120.0
WARM_UP_S = 0.5
LEARNERS = 2000
"""On all connections: each makes some tens of attempts."""
UNLIMITED = {"GRADER_RATE_PER_S": "100000", "GRADER_RATE_BURST": "100000"}

COMMITS = ("each", "gathered")
"""How the bare routes commit."""
SERVERS = ("service", *COMMITS)


@dataclass(frozen=True)
class Burst:
    """Times from request to response [s], answers a second, and the server's CPU time of one [s]."""

    times: Sequence[float]
    per_second: float
    cpu_s: float


@contextmanager
def open_database(backend: str) -> Iterator[str]:
    """The URL of an empty database. Raises psycopg.OperationalError where no PostgreSQL answers at POSTGRES."""
    if backend == "sqlite":
        with TemporaryDirectory() as folder:
            yield f"sqlite:///{folder}/bench.db"
        return
    name = f"grader_bench_{secrets.token_hex(4)}"
    with psycopg.connect(POSTGRES, autocommit=True) as connection:
        connection.execute(f"CREATE SCHEMA {name}")
        try:
            url = make_url(POSTGRES).update_query_dict({"options": f"-csearch_path={name}"})
            yield url.render_as_string(hide_password=False)
        finally:
            connection.execute(f"DROP SCHEMA {name} CASCADE")


def check_accepts(port: int) -> None:
    """Raises OSError until a server accepts connections."""
    socket.create_connection(("127.0.0.1", port), timeout=1).close()


@contextmanager
def start_process(
    arguments: list[str], port: int, settings: dict[str, str], ready: Callable[[int], None] = check_accepts
) -> Iterator[int]:
    """The id of a server on this port once it is ready. Raises RuntimeError if it does not start."""
    null = subprocess.DEVNULL  # the log too: a line for each request
    server = subprocess.Popen(  # noqa: S603  our own command
        [sys.executable, *arguments], env=os.environ | settings, stdout=null, stderr=null
    )
    try:
        end = time.monotonic() + START_S
        while True:
            if server.poll() is not None or time.monotonic() > end:
                raise RuntimeError(f"{arguments[0]} did not start")
            try:
                ready(port)
                break
            except OSError:
                time.sleep(0.1)
        yield server.pid
    finally:
        server.terminate()
        server.wait(timeout=30)


def build_serve_arguments(port: int, folder: str) -> list[str]:
    """Returns the arguments of `grader serve` with its data in a folder."""
    return ["-c", "from grader.commands.main import main; main()", "serve", "--port", str(port), "--data", folder]


def read_cpu_s(pid: int) -> float:
    """Returns the CPU time of a process so far, all its threads together [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def find_free_port() -> int:
    """Returns a free port on 127.0.0.1."""
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return int(listener.getsockname()[1])


@dataclass(frozen=True)
class Served:
    """A server that is measured: its process, and clients with a connection each."""

    pid: int
    clients: list[Client]

    def measure_burst(self, seconds: float) -> Burst:
        """Sends answers from every client at once for so long."""
        before_s = read_cpu_s(self.pid)
        times = send_together(self.clients, seconds)
        return Burst(times, len(times) / seconds, (read_cpu_s(self.pid) - before_s) / len(times))


def compare_with_bare(backend: str, students: int, rounds: int, seconds: float) -> Record:
    """Answers of the service and of both bare routes, in turn. What is found of each is the median of its bursts, with
    the least and the largest. `ratio` is the service's rate over that of a bare route in the same turn, `cpu_ratio` the
    service's CPU time of an answer over that of the route."""
    with ExitStack() as stack:
        served = {name: stack.enter_context(serve(name, backend, students)) for name in SERVERS}
        bursts = [{name: server.measure_burst(seconds) for name, server in served.items()} for _ in range(rounds)]
    servers = [{"server": name} | summarise_bursts([burst[name] for burst in bursts]) for name in SERVERS]
    ratios = {}
    for commits in COMMITS:
        rates = [burst["service"].per_second / burst[commits].per_second for burst in bursts]
        costs = [burst["service"].cpu_s / burst[commits].cpu_s for burst in bursts]
        ratios[commits] = summarise_values("ratio", rates) | summarise_values("cpu_ratio", costs)
    effort = {"learners": LEARNERS, "bursts": rounds, "seconds": seconds, "load_average": os.getloadavg()[0]}
    return {"servers": servers, "ratios": ratios, "effort": effort}


def summarise_bursts(bursts: Sequence[Burst]) -> Record:
    """Rate [1/s], CPU time of an answer [s] and percentiles of all times from request to response [s]."""
    times = [time_s for burst in bursts for time_s in burst.times]
    percentiles = map(float, np.percentile(times, [50, 95, 99]))
    return {
        "submissions": len(times),
        **summarise_values("per_second", [burst.per_second for burst in bursts]),
        **summarise_values("cpu_s", [burst.cpu_s for burst in bursts]),
        **dict(zip(("median_s", "p95_s", "p99_s"), percentiles, strict=True)),
    }


def summarise_values(name: str, values: Sequence[float]) -> Record:
    """The median under this name, with the least and the largest."""
    return {name: median(values), f"{name}_least": min(values), f"{name}_most": max(values)}


@contextmanager
def serve(name: str, backend: str, students: int) -> Iterator[Served]:
    """The service, or a bare route by how it commits, on an empty database, with clients that have sent an answer of
    every learner: the service looks up a credential when it is used for the first time."""
    with ExitStack() as stack:
        url, port = stack.enter_context(open_database(backend)), find_free_port()
        if name == "service":
            folder = Path(stack.enter_context(TemporaryDirectory()))
            write_class(folder)
            tokens = create_tokens(url, LEARNERS)
            arguments = build_serve_arguments(port, str(folder / "data"))
            settings = {"GRADER_WORKERS": "0", "GRADER_DATABASE_URL": url, "GRADER_CONTENT": str(folder)}
        else:
            tokens = [f"grt_{number:016x}_{0:064x}" for number in range(LEARNERS)]
            arguments, settings = ["-m", "grader.studies.bench.service.bare", name, url, str(port)], {}
        pid = stack.enter_context(start_process(arguments, port, UNLIMITED | settings))
        clients = [Client(port, make_requests(tokens[place::students], port, place)) for place in range(students)]
        for client in clients:
            stack.callback(client.close)
        send_together(clients, WARM_UP_S, -(-LEARNERS // students))
        yield Served(pid, clients)


def make_requests(tokens: Sequence[str], port: int, seed: int) -> Iterator[bytes]:
    """Yields the requests of one connection, without end: its learners hand in one after the other."""
    answers = make_answers(Random(seed))
    for token, (question, answer) in zip(cycle(tokens), answers, strict=False):
        yield build_request(token, port, {"quiz": QUIZ, "question": question, "answer": answer})


def list_backends() -> list[str]:
    """SQLite, and PostgreSQL where one answers at POSTGRES."""
    try:
        psycopg.connect(POSTGRES, connect_timeout=3).close()
    except psycopg.OperationalError:
        return ["sqlite"]
    return ["sqlite", "postgresql"]


def create_tokens(url: str, students: int) -> list[str]:
    """Returns a token for each student."""
    database = Database(url)
    database.migrate()
    with database.write() as session:
        tokens = [create_token(session, f"student{number}", "student", None) for number in range(students)]
    database.close()
    return tokens
