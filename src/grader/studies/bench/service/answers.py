"""Instant answers beside a bare FastAPI route that makes one durable insert: both servers in turn, in one run.

A busy machine flatters the ratio, since the bare route starves first. The bare route is served as after
`pip install fastapi uvicorn`: by h11 on asyncio. On each connection learners take turns, so that none makes hundreds of
attempts, which the service counts with every answer.
"""

import json
import os
import queue
import secrets
import socket
import sqlite3
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from itertools import cycle
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import psycopg
import uvicorn
from fastapi import FastAPI
from sqlalchemy.engine import make_url

from grader.courses.people.tokens import create_token
from grader.store.engine.database import Database
from grader.studies.bench.study import Record

POSTGRES = os.environ.get("GRADER_TEST_POSTGRES", "postgresql://postgres@127.0.0.1:5432/test")
START_S = 120.0
PATH = "/api/v1/submissions"
ANSWER = {"quiz": "1.3-check", "question": "q1", "answer": 1}
TABLE = "CREATE TABLE IF NOT EXISTS answers (id text PRIMARY KEY, body text NOT NULL)"
LEARNERS = 2000
"""On all connections: each makes some thirty attempts."""
UNLIMITED = {"GRADER_RATE_PER_S": "100000", "GRADER_RATE_BURST": "100000"}


def build_bare_app(url: str) -> FastAPI:
    """Returns one route that checks a body and commits one row before it answers."""
    app, insert = FastAPI(), make_inserter(url)

    @app.post(PATH, status_code=201)
    def keep(body: dict[str, Any]) -> dict[str, Any]:
        answer_id = secrets.token_hex(16)
        insert(answer_id, json.dumps(body))
        return {"id": answer_id, **body}

    return app


def make_inserter(url: str) -> Callable[[str, str], None]:
    """Inserts and commits one row: with synchronous=FULL on SQLite, as PostgreSQL does by default."""
    if url.startswith("sqlite:"):
        turn = threading.Lock()
        database = sqlite3.connect(url.removeprefix("sqlite:///"), check_same_thread=False)
        database.executescript(f"PRAGMA journal_mode = WAL; PRAGMA synchronous = FULL; {TABLE}")

        def insert_lite(answer_id: str, body: str) -> None:
            with turn, database:
                database.execute("INSERT INTO answers VALUES (?, ?)", (answer_id, body))

        return insert_lite
    free: queue.LifoQueue[psycopg.Connection[Any]] = queue.LifoQueue()
    for _ in range(40):  # as many as threads that serve requests
        free.put(psycopg.connect(url, autocommit=True))
    with psycopg.connect(url, autocommit=True) as first:
        first.execute(TABLE)

    def insert(answer_id: str, body: str) -> None:
        connection = free.get()
        try:
            connection.execute("INSERT INTO answers VALUES (%s, %s)", (answer_id, body))
        finally:
            free.put(connection)

    return insert


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
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


class Client:
    """A connection that sends the answers of learners in turn; it costs the machine as little as possible."""

    def __init__(self, port: int, tokens: Sequence[str]) -> None:
        self.port, self.learners = port, len(tokens)
        self.requests = cycle([build_request(token, port) for token in tokens])
        self.connect()

    def connect(self) -> None:
        """Opens a new connection: a server closes those that are idle."""
        self.socket = socket.create_connection(("127.0.0.1", self.port), timeout=60)

    def close(self) -> None:
        """Closes the connection."""
        self.socket.close()

    def answer(self) -> float:
        """Sends the answer; the time until the whole response is there [s]. Raises RuntimeError without a 201."""
        begin = time.perf_counter()
        self.socket.sendall(next(self.requests))
        got = self._receive()
        while (end := got.find(b"\r\n\r\n")) < 0:
            got += self._receive()
        head = got[:end].lower()
        length = int(head.split(b"content-length:")[1].split(b"\r\n")[0])
        while len(got) < end + 4 + length:
            got += self._receive()
        if not got.startswith(b"HTTP/1.1 201"):
            raise RuntimeError(f"the server answered {got[:500]!r}")
        return time.perf_counter() - begin

    def _receive(self) -> bytes:
        part = self.socket.recv(65536)
        if not part:
            raise RuntimeError("the server closed the connection")
        return part


def build_request(token: str, port: int) -> bytes:
    """Returns the request that hands in `ANSWER` with this token."""
    body = json.dumps(ANSWER).encode()
    head = f"POST {PATH} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nAuthorization: Bearer {token}\r\n"
    return f"{head}Content-Type: application/json\r\nContent-Length: {len(body)}\r\n\r\n".encode() + body


def run_together(clients: list[Client], work: Callable[[Client], list[float]]) -> list[float]:
    """The times of all clients [s], which work at once, on new connections: a server closes those that are idle."""
    for client in clients:
        client.close()
        client.connect()
    with ThreadPoolExecutor(len(clients)) as pool:
        return [time_s for times in pool.map(work, clients) for time_s in times]


def send_burst(clients: list[Client], seconds: float) -> list[float]:
    """Sends one answer after the other from every client for so long; returns the times of all [s]."""

    def one(client: Client) -> list[float]:
        until, times = time.perf_counter() + seconds, []
        while time.perf_counter() < until:
            times.append(client.answer())
        return times

    return run_together(clients, one)


def compare_with_bare(backend: str, students: int, rounds: int, seconds: float) -> Record:
    """Answers a second of the bare route and of the service, in turn; the ratio is the median of the pairs. `cpu_s` and
    `bare_cpu_s` are the CPU times of the servers for one answer: they tell more on a busy machine."""
    with ExitStack() as stack:
        urls = [stack.enter_context(open_database(backend)) for _ in range(2)]
        ports = [find_free_port(), find_free_port()]
        tokens = create_tokens(urls[1], LEARNERS)
        bare_route = ["-m", "grader.studies.bench.service.answers", urls[0], str(ports[0])]
        pids = [stack.enter_context(start_process(bare_route, ports[0], {}))]
        serve = build_serve_arguments(ports[1], stack.enter_context(TemporaryDirectory()))
        settings = UNLIMITED | {"GRADER_WORKERS": "0", "GRADER_DATABASE_URL": urls[1]}
        pids.append(stack.enter_context(start_process(serve, ports[1], settings)))
        bare, ours = ([Client(port, tokens[place::students]) for place in range(students)] for port in ports)
        for clients in (bare, ours):
            for client in clients:
                stack.callback(client.close)
            # The service looks up a credential when it is used for the first time.
            run_together(clients, lambda client: [client.answer() for _ in range(client.learners)])
            send_burst(clients, 0.5)
        before = [read_cpu_s(pid) for pid in pids]
        pairs = [(send_burst(bare, seconds), send_burst(ours, seconds)) for _ in range(rounds)]
        counts = [sum(len(pair[place]) for pair in pairs) for place in (0, 1)]
        costs = [(read_cpu_s(pid) - since) / count for pid, since, count in zip(pids, before, counts, strict=True)]
        middle, late, last = np.percentile([time_s for _, times in pairs for time_s in times], [50, 95, 99])
    return {
        "submissions": counts[1],
        "per_second": median(len(other) for _, other in pairs) / seconds,
        "median_s": float(middle),
        "p95_s": float(late),
        "p99_s": float(last),
        "bare_per_second": median(len(one) for one, _ in pairs) / seconds,
        "ratio": median(len(other) / len(one) for one, other in pairs),
        "cpu_s": costs[1],
        "bare_cpu_s": costs[0],
        "load_average": os.getloadavg()[0],
    }


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


def serve_bare(url: str, port: str) -> None:
    """Serves the bare route on the database of an address."""
    app = build_bare_app(url)
    uvicorn.run(app, port=int(port), log_level="warning", access_log=False, http="h11", loop="asyncio")


if __name__ == "__main__":
    serve_bare(*sys.argv[1:])
