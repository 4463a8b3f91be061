"""A server as a process, handed scripts while parts of it are killed. `soak.py` and the tests share it."""

import json
import os
import random
import signal
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import httpx

from grader.service.app import create_app
from grader.settings import Settings
from support.forked_commands import Forked, fork_command
from support.processes import descendants_running
from support.servers import PLAIN, serving
from support.tokens import issue_token

START_S = 120.0
GRADED_S = 240.0
RATE = 100_000
"""Requests a second that no test makes."""

PAUSES = "import time\ntime.sleep(0.3)\n\ndef largest_stable_timestep(model, integrator):\n    return 0.0015\n"
"""Runs long enough to be killed in the middle; its answer is wrong for every model."""


@contextmanager
def process_of(command: str, settings: Settings, before: str = "", log: Path | None = None) -> Iterator[Forked]:
    """`grader serve` or `grader worker` with these settings; killed at the end, whatever the test has done to it.

    The process runs the code `before` first, and writes its log to `log`.
    """
    environment = {
        **os.environ,
        "GRADER_CONTENT": str(settings.content),
        "GRADER_DATA": str(settings.data),
        "GRADER_PORT": str(settings.port),
        "GRADER_WORKERS": str(settings.workers),
        "GRADER_TRIES": str(settings.tries),
        "GRADER_RATE_PER_S": str(RATE),
        "GRADER_RATE_BURST": str(RATE),
    }
    if settings.database_url:
        environment["GRADER_DATABASE_URL"] = settings.database_url
    with fork_command(command, environment, before, log) as process:
        yield process


@contextmanager
def next_server(settings: Settings) -> Iterator[None]:
    """The server that follows a killed one, in this process: to import it again would take most of its start."""
    app = create_app(settings.model_copy(update={"rate_per_s": RATE, "rate_burst": RATE}))
    with serving(app, settings.port):
        yield
    app.state.services.database.close()


def settings_on(database_url: str | None, folder: Path, workers: int = 1, tries: int = 3) -> Settings:
    """The lesson on a free port."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    return Settings(
        data=folder,
        database_url=database_url,
        port=port,
        workers=workers,
        tries=tries,
        queue_per_user=1000,
    )


def wait_until_ready(process: Forked, settings: Settings) -> None:
    """A server without workers of its own is ready only beside others: until it answers at all then."""
    deadline = time.monotonic() + START_S
    while True:
        assert process.poll() is None, "the server ended"
        assert time.monotonic() < deadline, "the server does not become ready"
        try:
            seen = httpx.get(f"{settings.origin}/readyz", timeout=START_S, verify=PLAIN)
            if seen.status_code == 200 or (not settings.workers and "checks" in seen.json()):
                return
        except httpx.TransportError:
            pass
        time.sleep(0.1)


def wait_for(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + START_S
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.05)


def client_of(settings: Settings, user: str, role: str = "student") -> httpx.Client:
    token = issue_token(settings, user, role, None)
    return httpx.Client(
        base_url=settings.origin, headers={"Authorization": f"Bearer {token}"}, timeout=START_S, verify=PLAIN
    )


def hand_in(client: httpx.Client, number: int, source: str = PAUSES) -> str:
    """The id of an acknowledged submission."""
    made = handed_in(client, f"{source}# {number}\n")
    assert made.status_code == 202, made.text
    return str(made.json()["id"])


def handed_in(client: httpx.Client, source: str) -> httpx.Response:
    """What the server answers to a script."""
    body = {"quiz": "1.3-exercises", "question": "servo-threshold", "answer": {"source": source}}
    return client.post("/api/v1/submissions", json=body)


def kill_grading_process(server: int, draw: random.Random) -> None:
    """Kills one of the grading processes."""
    kill(server, ("grader.grading.process_main",), draw)


def kill_zygote(server: int, draw: random.Random) -> None:
    """Kills a process of the jail: the zygote, one of its children, or bubblewrap."""
    kill(server, ("zygote", "bwrap"), draw)


def kill(server: int, names: tuple[str, ...], draw: random.Random) -> None:
    """Kills one of the processes below `server` whose command line holds one of the names; waits for one."""
    deadline = time.monotonic() + START_S
    while True:
        processes = descendants_running(server, *names)
        if processes:
            with suppress(ProcessLookupError):
                os.kill(draw.choice(processes), signal.SIGKILL)
                return
        assert time.monotonic() < deadline, f"no process {names}"
        time.sleep(0.05)


def verdicts_of(client: httpx.Client, ids: list[str]) -> dict[str, dict[str, Any]]:
    """Every submission once it is graded."""
    deadline = time.monotonic() + GRADED_S
    graded: dict[str, dict[str, Any]] = {}
    while len(graded) < len(ids):
        assert time.monotonic() < deadline, f"{len(ids) - len(graded)} of {len(ids)} are not graded"
        for id_ in ids:
            if id_ not in graded:
                shown = json.loads(client.get(f"/api/v1/submissions/{id_}").text)
                if shown["status"] == "graded":
                    graded[id_] = shown
        time.sleep(0.1)
    return graded
