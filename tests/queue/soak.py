"""Rounds of `kill -9` on a server, its grading processes and its jail while learners hand in scripts.

    PYTHONPATH=src:tests python tests/queue/soak.py [ROUNDS] [sqlite|postgresql]

Exits 1 unless every acknowledged submission has exactly one verdict, and none of them is a grader_fault.
"""

import random
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

from sqlalchemy import func, select

from grader.queue import jobs
from grader.settings import Settings
from grader.store.engine.database import Database
from grader.store.tables import VerdictRow
from support.databases import BACKENDS, database_url
from support.queue_kills import (
    client_of,
    hand_in,
    kill_grading_process,
    kill_zygote,
    process_of,
    settings_on,
    verdicts_of,
    wait_until_ready,
)

LEARNERS = 3


def one_round(settings: Settings, number: int, draw: random.Random) -> list[str]:
    """Hands in a script of each learner, and kills something in the middle: the server at the end of every round."""
    ids = []
    with process_of("serve", settings) as server:
        wait_until_ready(server, settings)
        for learner in range(LEARNERS):
            with client_of(settings, f"user{learner}") as client:
                ids.append(hand_in(client, LEARNERS * number + learner))
        time.sleep(draw.uniform(0.0, 1.0))
        if victim := draw.choice((kill_grading_process, kill_zygote, None)):
            victim(server.pid, draw)
            time.sleep(draw.uniform(0.0, 1.0))
    return ids


def soak(rounds: int, backend: str) -> bool:
    """Whether every submission of all rounds was graded exactly once."""
    draw = random.Random(rounds)
    with TemporaryDirectory() as folder, database_url(backend, Path(folder)) as url:
        settings = settings_on(url, Path(folder) / "data", workers=2, tries=50)
        ids = []
        for number in range(rounds):
            ids += one_round(settings, number, draw)
            print(f"{backend}: round {number + 1} of {rounds}", file=sys.stderr)
        with process_of("serve", settings) as server, client_of(settings, "tina", "instructor") as client:
            wait_until_ready(server, settings)
            statuses = [verdict["verdict"]["status"] for verdict in verdicts_of(client, ids).values()]
        database = Database(url)
        with database.read() as session:
            counts = list(session.scalars(select(func.count(VerdictRow.id)).group_by(VerdictRow.submission_id)))
            left = jobs.count_jobs(session)
        database.close()
    print(f"{backend}: {len(ids)} acknowledged, {len(counts)} graded, {sum(counts)} verdicts, {left} jobs left")
    return counts == [1] * len(ids) and left == 0 and "grader_fault" not in statuses


if __name__ == "__main__":
    wanted = sys.argv[2:] or BACKENDS
    results = [soak(int(sys.argv[1]) if len(sys.argv) > 1 else 50, backend) for backend in wanted]
    sys.exit(0 if all(results) else 1)
