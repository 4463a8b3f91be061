"""Parts of a running service are killed in the middle: every acknowledged submission is graded exactly once."""

import os
import random
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from sqlalchemy import func, select

from grader.queue import jobs
from grader.store.engine.database import Database
from grader.store.tables import VerdictRow
from support.outages import Disk
from support.processes import command_line, descendants
from support.queue_kills import (
    PAUSES,
    client_of,
    hand_in,
    handed_in,
    kill_grading_process,
    kill_zygote,
    next_server,
    process_of,
    settings_on,
    verdicts_of,
    wait_until_ready,
)

LONG = PAUSES + f"# {'long ' * 8000}\n"

TRIES = 20
"""Tries of a job: a test kills more often than a service is killed."""


def assert_graded_once(url: str, ids: list[str]) -> None:
    database = Database(url)
    with database.read() as session:
        counts = session.execute(select(VerdictRow.submission_id, func.count()).group_by(VerdictRow.submission_id))
        assert {row[0]: row[1] for row in counts} == dict.fromkeys(ids, 1)
        assert jobs.count_jobs(session) == 0
    database.close()


@pytest.mark.parametrize(
    ("url", "kill"), [("sqlite", kill_grading_process), ("postgresql", kill_zygote)], indirect=["url"]
)
def test_a_killed_part_of_the_jail_costs_nobody_a_verdict(
    url: str, tmp_path: Path, kill: Callable[[int, random.Random], None]
) -> None:
    draw = random.Random(1)
    settings = settings_on(url, tmp_path / "data", tries=TRIES)
    with process_of("serve", settings) as server:
        wait_until_ready(server, settings)
        ids: list[str] = []
        with client_of(settings, "ann") as client:
            for number in range(2):
                ids.append(hand_in(client, number))
                time.sleep(draw.uniform(0.1, 0.4))
                kill(server.pid, draw)
            shown = verdicts_of(client, ids)
    assert {one["verdict"]["status"] for one in shown.values()} == {"incorrect"}
    assert_graded_once(url, ids)


@pytest.mark.parametrize("url", ["sqlite"], indirect=True)  # on PostgreSQL the full disk beside kills shows the same
def test_a_killed_server_leaves_no_process_behind_and_the_next_one_grades_the_rest(url: str, tmp_path: Path) -> None:
    settings = settings_on(url, tmp_path / "data", tries=TRIES)
    with process_of("serve", settings) as server:
        wait_until_ready(server, settings)
        with client_of(settings, "ann") as client:
            ids = [hand_in(client, number) for number in range(3)]
        time.sleep(0.4)
        below = descendants(server.pid)
        assert below
    deadline = time.monotonic() + 20
    while any(command_line(pid) for pid in below):
        assert time.monotonic() < deadline, "a process outlived its server"
        time.sleep(0.05)
    with next_server(settings), client_of(settings, "ann") as client:
        shown = verdicts_of(client, ids)
    assert {one["verdict"]["status"] for one in shown.values()} == {"incorrect"}
    assert_graded_once(url, ids)


def test_a_full_disk_beside_kills_costs_nobody_a_verdict(url: str, tmp_path: Path) -> None:
    """Filled while scripts run; then a grading process and the server are killed, and only then there is room again."""
    settings, disk, draw = (
        settings_on(url, tmp_path / "data", tries=TRIES),
        Disk(url, tmp_path / "full"),
        random.Random(1),
    )
    ids: list[str] = []
    with process_of("serve", settings, disk.before) as server:
        wait_until_ready(server, settings)
        with client_of(settings, "ann") as client:
            ids += [hand_in(client, number) for number in range(2)]
            disk.fill()
            while (refused := handed_in(client, LONG + f"# {len(ids)}")).status_code == 202:
                ids.append(refused.json()["id"])  # into pages that are free within the file
            assert refused.status_code == 503
            assert int(refused.headers["retry-after"]) > 0
            kill_grading_process(server.pid, draw)
            time.sleep(0.4)
    disk.free()
    with next_server(settings), client_of(settings, "ann") as client:
        ids.append(hand_in(client, 99))
        shown = verdicts_of(client, ids)
    assert {one["verdict"]["status"] for one in shown.values()} == {"incorrect"}
    assert_graded_once(url, ids)


HOLDS = """
import time
from grader.grading.processes import Graders
with Graders(1, allow_t2=False):
    print("ready", flush=True)
    time.sleep(600)
"""


def test_grading_processes_leave_no_folder_behind_where_their_parent_was_killed(tmp_path: Path) -> None:
    environment = {**os.environ, "TMPDIR": str(tmp_path)}
    with subprocess.Popen([sys.executable, "-c", HOLDS], env=environment, stdout=subprocess.PIPE) as parent:
        assert parent.stdout is not None
        assert parent.stdout.readline() == b"ready\n"
        assert list(tmp_path.glob("grader-models-*"))
        parent.kill()
    deadline = time.monotonic() + 60
    while list(tmp_path.glob("grader-models-*")):
        assert time.monotonic() < deadline, "the folder of models was left behind"
        time.sleep(0.05)
