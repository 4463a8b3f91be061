"""`GRADER_PROCESSES`: two servers on one socket and a worker beside them, as processes, on PostgreSQL."""

import json
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
import pytest
from pydantic import ValidationError
from sqlalchemy import text

from grader.courses.answering.stopping import STOPPED_RUNNING
from grader.errors import TooManyRequests
from grader.service.accounts import revoke_tokens
from grader.service.app import admission_rules
from grader.service.processes import FAULT
from grader.settings import Settings
from grader.store.engine.database import Database
from support.databases import database_url
from support.processes import command_line, descendants, listening_children
from support.queue_kills import START_S, process_of, settings_on, wait_for, wait_until_ready
from support.tokens import issue_token

SUBMISSIONS = "/api/v1/submissions"
CHOICE = {"quiz": "1.3-check", "question": "q1", "answer": 1}
GRADER = Path(sys.executable).parent / "grader"
SCRIPT = {"source": "def largest_stable_timestep(model, integrator):\n    return None\n"}


class Served:
    """A running `grader serve`, with a way to each of its servers."""

    def __init__(self, pid: int, settings: Settings) -> None:
        self.pid, self.settings = pid, settings

    def servers(self) -> list[int]:
        """The servers; the worker listens on no port."""
        return listening_children(self.pid)

    @contextmanager
    def client_at(self, server: int, token: str) -> Iterator[httpx.Client]:
        """A client with a connection to this server, once that accepts: it is made while the others stand still."""
        others = [one for one in self.servers() if one != server]
        headers = {"Authorization": f"Bearer {token}"}
        with httpx.Client(base_url=self.settings.origin, headers=headers, timeout=START_S) as client:
            for other in others:
                os.kill(other, signal.SIGSTOP)
            try:
                assert client.get("/healthz").status_code == 200
            finally:
                for other in others:
                    os.kill(other, signal.SIGCONT)
            yield client

    def token(self, user: str, role: str = "student") -> str:
        return issue_token(self.settings, user, role, None)


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    """Ended by SIGTERM, which must leave nothing behind, and no interpreter that broke off."""
    folder = tmp_path_factory.mktemp("processes")
    with database_url("postgresql", folder) as url, pytest.MonkeyPatch.context() as patch:
        patch.setenv("GRADER_PROCESSES", "2")
        settings = settings_on(url, folder, workers=1).model_copy(update={"processes": 2})
        with process_of("serve", settings, log=folder / "log") as process:
            wait_until_ready(process, settings)
            one = Served(process.pid, settings)
            wait_for(lambda: len(one.servers()) == 2)
            yield one
            started = descendants(process.pid)
            process.terminate()
            assert process.wait(START_S) == 0
            assert [pid for pid in started if command_line(pid)] == []
            assert "Fatal" not in (folder / "log").read_text()


def counted(client: httpx.Client) -> float:
    """The answers that /metrics says were handed in."""
    wanted = f'grader_http_requests_total{{method="POST",route="{SUBMISSIONS}",status="201"}} '
    lines = client.get("/metrics").text.splitlines()
    return sum(float(line.removeprefix(wanted)) for line in lines if line.startswith(wanted))


pytestmark = [pytest.mark.postgres, pytest.mark.process, pytest.mark.jail, pytest.mark.slow]


def test_each_server_takes_answers_and_both_count_together(served: Served) -> None:
    token = served.token("ann")
    for server in served.servers():
        with served.client_at(server, token) as client:
            made = client.post(SUBMISSIONS, json=CHOICE)
            assert made.status_code == 201, made.text
    for server in served.servers():
        with served.client_at(server, token) as client:
            assert len(client.get(SUBMISSIONS).json()["items"]) == 2
            assert counted(client) == 2


def test_a_revoked_token_is_refused_by_both(served: Served) -> None:
    token = served.token("bob")
    first, second = served.servers()
    with served.client_at(first, token) as one, served.client_at(second, token) as other:
        assert [client.post(SUBMISSIONS, json=CHOICE).status_code for client in (one, other)] == [201, 201]
        assert revoke_tokens(served.settings, "bob", None) == 1
        assert [client.post(SUBMISSIONS, json=CHOICE).status_code for client in (one, other)] == [401, 401]


def test_a_verdict_is_heard_at_the_other_server(served: Served) -> None:
    token = served.token("cid")
    first, second = served.servers()
    with served.client_at(first, token) as one, served.client_at(second, token) as other:
        made = one.post(SUBMISSIONS, json={"quiz": "1.3-exercises", "question": "servo-threshold", "answer": SCRIPT})
        assert made.status_code == 202, made.text
        assert events_of(other, made.headers["location"])[-1]["verdict"]["status"] == "incorrect"


def test_a_script_that_runs_is_stopped_at_the_other_server(served: Served) -> None:
    token, endless = served.token("eve"), {"source": "while True:\n    pass\n"}
    first, second = served.servers()
    with served.client_at(first, token) as one, served.client_at(second, token) as other:
        made = one.post(SUBMISSIONS, json={"quiz": "1.3-exercises", "question": "servo-threshold", "answer": endless})
        address = made.headers["location"]
        wait_for(lambda: one.get(address).json()["status"] == "running")
        stopped = other.post(f"{address}:stop")
        assert stopped.status_code == 200, stopped.text
        assert stopped.json()["verdict"]["diagnosis"] == STOPPED_RUNNING
        assert one.get(address).json()["status"] == "graded"


def events_of(client: httpx.Client, location: str) -> list[dict[str, Any]]:
    """The data of all events until the stream ends."""
    with client.stream("GET", f"{location}/events") as stream:
        return [json.loads(line.removeprefix("data:")) for line in stream.iter_lines() if line.startswith("data:")]


def test_a_killed_server_is_replaced_while_the_other_answers(served: Served) -> None:
    killed, other = served.servers()
    token = served.token(f"dot-{killed}")  # another learner where the test is run again
    acknowledged: list[str] = []
    with served.client_at(other, token) as client:
        stop = threading.Event()

        def hand_in() -> None:
            while not stop.is_set():
                made = client.post(SUBMISSIONS, json=CHOICE)
                assert made.status_code == 201, made.text
                acknowledged.append(made.json()["id"])

        handing_in = threading.Thread(target=hand_in)
        handing_in.start()
        try:
            os.kill(killed, signal.SIGKILL)
            wait_for(lambda: len({*served.servers()} - {killed}) == 2)
        finally:
            stop.set()
            handing_in.join()
        (new,) = set(served.servers()) - {other}
        with served.client_at(new, token) as fresh:
            made = fresh.post(SUBMISSIONS, json=CHOICE)
            assert made.status_code == 201
            newest = [item["id"] for item in fresh.get(SUBMISSIONS, params={"limit": 100}).json()["items"]]
    assert acknowledged
    assert newest == [made.json()["id"], *reversed(acknowledged)][:100]


COUNTS = """
import sys
from pathlib import Path
from grader.metrics import shared_folder
with shared_folder() as folder:
    (Path(folder) / "counter_1.db").touch()
    print(folder, flush=True)
    sys.stdin.read()
"""


def test_the_folder_of_metrics_of_a_killed_serve_is_removed_by_the_next(tmp_path: Path) -> None:
    environment = {**os.environ, "TMPDIR": str(tmp_path)}

    @contextmanager
    def counting() -> Iterator[tuple[subprocess.Popen[str], str]]:
        with subprocess.Popen(
            [sys.executable, "-c", COUNTS], env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        ) as process:
            assert process.stdout is not None
            yield process, process.stdout.readline().strip()

    def folders() -> set[str]:
        return {str(path) for path in tmp_path.iterdir()}

    with counting() as (killed, left), counting() as (_, kept):
        killed.kill()
        killed.wait()
        assert folders() == {left, kept}
        with counting() as (_, new):
            assert folders() == {kept, new}
    assert folders() == set()


ALONE = {"GRADER_PROCESSES": "1", "GRADER_WORKERS": "0"}


def serve_in(folder: Path) -> list[str]:
    return [str(GRADER), "serve", "--port", "0", "--data", str(folder)]


def be_refused(folder: Path) -> str:
    """What a server says that does not start."""
    refused = subprocess.run(
        serve_in(folder), capture_output=True, text=True, check=False, env=os.environ | ALONE, timeout=60
    )
    assert (refused.returncode, refused.stdout) == (FAULT, "")
    return refused.stderr


def test_a_second_server_on_a_sqlite_database_is_refused_until_the_first_has_ended(tmp_path: Path) -> None:
    for _ in range(2):  # the second one is there after the first was killed
        with subprocess.Popen(serve_in(tmp_path), stdout=subprocess.PIPE, text=True, env=os.environ | ALONE) as first:
            try:
                assert first.stdout is not None and first.stdout.readline().startswith("Student page:")
                assert f"no database in {tmp_path} (another server works on it)" in be_refused(tmp_path)
            finally:
                first.kill()


def test_a_folder_that_cannot_hold_a_database_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    told = be_refused(tmp_path / "file")
    assert f"no database in {tmp_path / 'file'} (File exists): name another folder with --data or GRADER_DATA" in told


def test_several_processes_are_refused_on_sqlite() -> None:
    with pytest.raises(ValidationError, match=r"GRADER_PROCESSES above 1 needs PostgreSQL.* set GRADER_DATABASE_URL"):
        Settings(processes=2)


def settings_with(processes: int) -> Settings:
    return Settings(processes=processes, database_url="postgresql://db.internal/grader")


def test_processes_share_the_connections_that_one_may_have() -> None:
    assert settings_with(1).connections == 64
    assert [(n + 1) * settings_with(n).connections for n in range(2, 8)] == [63, 64, 60, 60, 63, 64]
    assert settings_with(64).connections == 8


def test_a_thread_waits_where_all_connections_are_in_use(tmp_path: Path) -> None:
    database, reading = Database(f"sqlite:///{tmp_path}/grader.db", connections=2), threading.Event()

    def read() -> None:
        with database.read() as session:
            session.execute(text("SELECT 1"))
            reading.set()

    with database.read() as one, database.read() as other:
        for session in (one, other):
            session.execute(text("SELECT 1"))
        third = threading.Thread(target=read)
        third.start()
        assert not reading.wait(0.1)
        other.close()
        assert reading.wait(START_S)
    third.join()
    database.close()


def test_each_process_has_its_share_of_the_rate_limits() -> None:
    settings = Settings(
        database_url="postgresql://localhost/x", processes=4, rate_per_s=8, rate_burst=8, address_rate_burst=2
    )
    rules = admission_rules(settings)
    for _ in range(2):
        rules.by_user.spend("ann")
    with pytest.raises(TooManyRequests):
        rules.by_user.spend("ann")
    rules.by_address.spend("::1")  # at least one
    with pytest.raises(TooManyRequests):
        rules.by_address.spend("::1")


def test_a_default_share_does_not_depend_on_the_number_of_processes() -> None:
    one, four = (Settings(database_url="postgresql://localhost/x", processes=count) for count in (1, 4))
    for name in ("rate_per_s", "rate_burst", "address_rate_per_s", "address_rate_burst", "lab_steps_per_min"):
        assert four.share(getattr(four, name)) == getattr(one, name)
