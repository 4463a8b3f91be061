"""The clock of PostgreSQL jumps back an hour beside two workers: no job waits for that hour, and none is done twice."""

import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import psycopg
import pytest
from sqlalchemy import func, make_url, select

from grader.domain.verdict import Status, Verdict
from grader.grading.pipeline import Retries
from grader.queue import jobs
from grader.queue.jobs import JobRow
from grader.queue.worker import Worker
from grader.service.worker import GradingTask
from grader.store import submissions
from grader.store.engine.database import Database
from grader.store.engine.ids import make_id
from grader.store.tables import Submission, VerdictRow
from support.databases import database_url

GOOD = Verdict(status=Status.CORRECT, points=1.0, max_points=1.0)
PAUSE_S = 600.0
"""How long a job that failed would wait: longer than this test."""
WAIT_S = 60.0

CLOCK = """
CREATE TABLE behind AS SELECT interval '0' AS by;
CREATE FUNCTION clock_timestamp() RETURNS timestamptz LANGUAGE sql
    AS 'SELECT pg_catalog.clock_timestamp() - by FROM behind';
"""
"""A clock that can be set, found before PostgreSQL's own."""


@pytest.fixture
def url(tmp_path: Path) -> Iterator[str]:
    """A database whose clock can be set."""
    with database_url("postgresql", tmp_path) as plain:
        options = str(make_url(plain).query["options"])
        ours = make_url(plain).update_query_dict({"options": f"{options},pg_catalog"})
        with psycopg.connect(plain, autocommit=True) as connection:
            connection.execute(CLOCK)
        yield ours.render_as_string(hide_password=False)


def hand_in(database: Database, number: int) -> str:
    submission = Submission(
        id=make_id(), course="c", learner=f"user{number}", user=f"user{number}", quiz="quiz", question="q",
        answer="{}", content_digest="d", attempt=1,
    )  # fmt: skip
    with database.write() as session:
        submissions.add(session, [(submission, None)])
        jobs.put(session, jobs.GRADE, submission.id, share=submission.learner)
    return submission.id


def wait_until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + WAIT_S
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.02)


@pytest.mark.postgres
def test_a_clock_that_jumps_back_beside_two_workers(url: str) -> None:
    """Some jobs have failed and wait, some run, some come later."""
    here, there = Database(url), Database(url)
    here.migrate()
    tries, jumped = Counter[str](), threading.Event()
    slow, failing = set[str](), set[str]()

    def grade(submission: Submission) -> Verdict:
        tries[submission.id] += 1
        if submission.id in slow:
            assert jumped.wait(WAIT_S)
        if submission.id in failing and tries[submission.id] == 1:
            raise RuntimeError("the first try fails")
        return GOOD

    def count(*conditions: object) -> int:
        with here.read() as session:
            return session.scalar(select(func.count()).select_from(JobRow).where(*conditions)) or 0  # type: ignore[arg-type]

    ids = [hand_in(here, number) for number in range(9)]
    slow |= {ids[0], ids[4]}
    failing |= {*ids[1:4], *ids[5:8], ids[4]}
    workers = [
        Worker(database, {jobs.GRADE: GradingTask(grade, lambda _: GOOD)}, 2, Retries(3, pause_s=PAUSE_S))
        for database in (here, there)
    ]
    for worker in workers:
        worker.start()
    wait_until(lambda: count(JobRow.due_at.is_not(None)) == 6 and count() == 8)
    assert len(tries) == 9
    with here.write() as session:
        session.connection().exec_driver_sql("UPDATE behind SET by = interval '1 hour'")
    jumped.set()
    ids += [hand_in(there, number) for number in range(9, 12)]
    wait_until(lambda: count(JobRow.subject != ids[4]) == 0)
    # What failed after the jump waits by the new time, as it should; set forward again, it is due.
    assert count() == 1
    with here.write() as session:
        session.connection().exec_driver_sql("UPDATE behind SET by = interval '0'")
    wait_until(lambda: count() == 0)
    for worker in workers:
        worker.stop()
    with here.read() as session:
        verdicts = session.execute(select(VerdictRow.submission_id, func.count()).group_by(VerdictRow.submission_id))
        assert {row[0]: row[1] for row in verdicts} == dict.fromkeys(ids, 1)
    assert tries == {id_: 2 if id_ in failing else 1 for id_ in ids}
    for database in (here, there):
        database.close()
