"""A course of 40 learners at each platform, with faults in three of ten requests and a sender that is killed."""

import json
import os
import random
import signal
import subprocess
import sys
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass
from datetime import datetime, timedelta
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import func, select

from grader.courses.people.identity import Identity
from grader.grading.content import Contents
from grader.service.worker import OTHERS
from grader.store.engine.database import Database
from grader.store.outbox import DEAD, SENT, Delivery
from platforms.classes import Class
from platforms.profiles import BLACKBOARD, CANVAS_LMS, MOODLE, OPEN_EDX, Profile, Simulated, simulated
from support.databases import database_url
from support.sites import write_content

LEARNERS = 40
OVERRIDDEN = 5
PATIENCE_S = 150.0
TESTS = Path(__file__).parents[1]


@dataclass(frozen=True)
class Sender:
    """A process that sends scores."""

    pid: int

    def kill(self) -> None:
        """Ends it in the middle of whatever it does; returns once it is gone."""
        with suppress(ProcessLookupError):
            os.kill(self.pid, signal.SIGKILL)
            wait_until(lambda: os.kill(self.pid, 0))


StartSender = Callable[[str, Simulated, int], AbstractContextManager[Sender]]
"""Starts a sender with so many threads."""


@pytest.fixture(scope="module")
def sending() -> Iterator[StartSender]:
    """Starts a sender, which is killed at the end of the context at the latest."""
    environment = {**os.environ, "PYTHONPATH": f"{TESTS.parent / 'src'}:{TESTS}", "OPENBLAS_NUM_THREADS": "1"}
    command = [sys.executable, "-P", "-m", "platforms.sending"]
    nursery = subprocess.Popen(command, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    @contextmanager
    def start(url: str, platform: Simulated, threads: int) -> Iterator[Sender]:
        assert nursery.stdin is not None
        assert nursery.stdout is not None
        where = [url, platform.origin, platform.client_id, platform.container, threads]
        print(json.dumps(where), file=nursery.stdin, flush=True)
        sender = Sender(int(nursery.stdout.readline()))
        try:
            yield sender
        finally:
            sender.kill()

    with nursery:
        yield start
        nursery.kill()


def count(database: Database, *states: str) -> int:
    with database.read() as session:
        return session.scalar(select(func.count()).where(Delivery.state.in_(states))) or 0


def wait_until(condition: Any) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < deadline, "the deliveries do not come to an end"
        time.sleep(0.05)


def kill_in_the_middle(sender: Sender, platform: Simulated, taken: int) -> None:
    """SIGKILL, wherever the sender is, once the platform has taken so many scores."""
    wait_until(lambda: len(platform.taken) >= taken)
    sender.kill()


def number(one: Identity) -> int:
    return int(one.user.removeprefix("learner"))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("profile", "backend", "killed", "threads"),
    [
        (CANVAS_LMS, "postgresql", "in the first scores", OTHERS),
        (MOODLE, "sqlite", "in the first scores", 1),
        (OPEN_EDX, "postgresql", "in the changes", 1),
        (BLACKBOARD, "sqlite", "in the changes", 1),
    ],
    ids=lambda one: one.name if isinstance(one, Profile) else str(one),
)
def test_every_final_grade_is_right_and_nothing_is_lost_or_sent_twice(
    sending: StartSender, profile: Profile, backend: str, killed: str, threads: int, tmp_path: Path
) -> None:
    """With as many threads as the service has once: each of them takes the processor from the others."""
    draw = random.Random(5)
    with database_url(backend, tmp_path) as url, simulated(profile, fault_rate=0.3, seed=7) as platform:
        database = Database(url)
        database.migrate()
        course = Class(database, Contents(write_content(tmp_path / "content"), {}, database))
        course.enrol([f"learner{place}" for place in range(LEARNERS)])
        course.send_scores()
        # All have answered; the open answers of every third learner wait for a reviewer.
        course.answer([(learner, "q1", number(learner) % 3) for learner in course.learners])
        course.answer([(learner, "q4", "because") for learner in course.learners[::3]])
        if killed == "in the first scores":
            with sending(url, platform, threads) as first:
                kill_in_the_middle(first, platform, draw.randrange(10, 26))
        with sending(url, platform, threads) as second:
            wait_until(lambda: count(database, SENT) == LEARNERS)
            (item,) = platform.items
            before = len(platform.taken)
            # A person enters grades; then all answer again, and the reviewer decides, while the sender sends.
            persons = course.learners[1 : 3 * OVERRIDDEN : 3]
            for one in persons:
                platform.enter(item, one.id, 0.77, 1.0)
            for start in range(0, LEARNERS, 10):
                some = course.learners[start : start + 10]
                course.answer([(one, "q2", "5 ms" if number(one) % 2 else "7 ms") for one in some])
            for one in course.learners[::3]:
                course.review(one, 0.5)
            if killed == "in the changes":
                kill_in_the_middle(second, platform, before + draw.randrange(3, 18))
            else:
                wait_until(lambda: count(database, SENT, DEAD) == LEARNERS)
        with sending(url, platform, threads):
            wait_until(lambda: count(database, SENT, DEAD) == LEARNERS)

        assert len(platform.items) == 1  # no duplicate column
        assert set(platform.faults) >= {"lost before", "lost after", "500", "503", "429", "401"}
        with database.read() as session:
            rows = {row.learner: row for row in session.scalars(select(Delivery))}
        changed = [person for person in persons if number(person) % 2]  # the others have the same points as before
        assert {key for key, row in rows.items() if row.state == DEAD} == {one.id for one in changed}
        assert all((rows[one.id].error or "").startswith("Overridden by a person") for one in changed)
        for one in course.learners:
            grade = platform.grades[item, one.id]
            right = 0.77 if one in persons else course.points(one) / 4.0
            assert grade.given is not None, one.user
            assert grade.given / grade.maximum == pytest.approx(right), one.user
        check_scores(platform)
        database.close()


def check_scores(platform: Simulated) -> None:
    """Strictly later timestamps by a second, no final score twice, none pending after it, no attempt used."""
    by_user = defaultdict(list)
    for score in platform.taken:
        by_user[score["userId"]].append(score)
    assert Counter(score["scoreMaximum"] for score in platform.taken if "scoreGiven" in score).keys() == {4.0}
    for scores in by_user.values():
        times = [datetime.fromisoformat(one["timestamp"]) for one in scores]
        assert all(later - earlier >= timedelta(seconds=1) for earlier, later in pairwise(times))
        final = [one["scoreGiven"] for one in scores if one["gradingProgress"] == "FullyGraded"]
        assert all(earlier != later for earlier, later in pairwise(final)), final
        progress = [one["gradingProgress"] == "FullyGraded" for one in scores]
        assert progress == sorted(progress)
    assert platform.attempts == {}
