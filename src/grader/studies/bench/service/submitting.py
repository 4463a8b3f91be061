"""Students of the real server: its jail and its database, over HTTP, in a process of its own, without rate limits."""

import json
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from http.client import HTTPConnection
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from urllib.request import urlopen

from grader.settings import Settings
from grader.studies.bench.service.answers import (
    UNLIMITED,
    build_serve_arguments,
    create_tokens,
    find_free_port,
    start_process,
)

GRADED_S = 60.0

SCRIPT = "def largest_stable_timestep(model, integrator):\n    return None\n"
"""Costs the jail a whole run and the grader a whole certificate, whatever the verdict."""

JUDGED = {
    "servo-threshold": "correct__the_lessons_script_and_a_bisection.py",
    "rk4-step": "correct__classical.py",
    "rk4-free-joint": "correct__quaternion_derivative.py",
}
"""Right answers; the last is judged by its convergence, which costs most."""


class Client:
    """One student with one connection."""

    def __init__(self, port: int, token: str, server: int) -> None:
        self.port, self.token = port, token
        self.server = server  # its process id
        self.connection = HTTPConnection("127.0.0.1", port, timeout=GRADED_S)
        self.headers = {"Authorization": f"Bearer {token}", "Content-Type": "application/json"}

    def open_another(self) -> "Client":
        """Returns the same student on a connection of its own."""
        return Client(self.port, self.token, self.server)

    def request(self, method: str, path: str, body: Any = None) -> tuple[int, Any]:
        """Status and JSON of a call under /api/v1."""
        self.connection.request(method, f"/api/v1{path}", json.dumps(body) if body else None, self.headers)
        answer = self.connection.getresponse()
        return answer.status, json.loads(answer.read())

    def answer(self) -> None:
        """Submit a typed number and check its verdict."""
        status, body = self.request("POST", "/submissions", {"quiz": "1.3-check", "question": "q2", "answer": "5 ms"})
        require(status == 201 and body["verdict"]["status"] == "correct", body)

    def hand_in(self, question: str, source: str) -> str:
        """Submit a script of the exercises; the id of the submission."""
        body = {"quiz": "1.3-exercises", "question": question, "answer": {"source": source}}
        status, submission = self.request("POST", "/submissions", body)
        require(status == 202, submission)
        return str(submission["id"])

    def watch_submission(self, submission_id: str) -> dict[str, Any]:
        """Listen to a submission's events until its verdict is there. Raises TimeoutError after GRADED_S."""
        self.connection.request("GET", f"/api/v1/submissions/{submission_id}/events", None, self.headers)
        events = self.connection.getresponse().read().decode()  # the stream ends with the verdict
        data = [line.removeprefix("data: ") for line in events.splitlines() if line.startswith("data: ")]
        verdict: dict[str, Any] = json.loads(data[-1])["verdict"]
        require(verdict["status"] != "grader_fault", verdict)
        return verdict

    def graded(self, question: str, source: str) -> dict[str, Any]:
        """Returns the verdict on a script of the exercises, once it is heard."""
        return self.watch_submission(self.hand_in(question, source))


def read_right_answer(exercise: str) -> str:
    """Returns the text of a reference solution."""
    folder = Settings().content / "reference_solutions" / "1.3-exercises" / exercise
    return (folder / JUDGED[exercise]).read_text(encoding="utf-8")


def require(held: bool, body: Any) -> None:
    """Raise RuntimeError for an unexpected answer: its time would say nothing."""
    if not held:
        raise RuntimeError(f"the service answered {body}")


def check_ready(port: int) -> None:
    """Raises OSError until the service grades."""
    urlopen(f"http://127.0.0.1:{port}/readyz", timeout=5).close()


@contextmanager
def serve_clients(students: int, **environment: str) -> Iterator[list[Client]]:
    """A client for each student of `grader serve`, on a free port with fresh data and these settings."""
    port, settings = find_free_port(), UNLIMITED | environment
    with (
        TemporaryDirectory() as folder,
        start_process(build_serve_arguments(port, folder), port, settings, check_ready) as server,
        ExitStack() as connections,
    ):
        url = environment.get("GRADER_DATABASE_URL") or Settings(data=Path(folder)).database
        asking = [Client(port, token, server) for token in create_tokens(url, students)]
        for client in asking:
            connections.callback(client.connection.close)
        yield asking
