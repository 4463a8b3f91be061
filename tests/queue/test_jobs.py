"""The queue on both databases: a job is done once, whatever happens to its workers."""

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from databases import BACKENDS, database_url
from grader.domain.verdict import Status, Verdict
from grader.queue import jobs
from grader.store import submissions
from grader.store.database import Database
from grader.store.tables import Submission, new_id
from grader.worker import Judge, Worker

GOOD = Verdict(status=Status.CORRECT, points=1.0, max_points=1.0)
OUR_FAULT = Verdict(status=Status.GRADER_FAULT, points=0.0, max_points=1.0)


@pytest.fixture(params=BACKENDS)
def url(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[str]:
    with database_url(request.param, tmp_path) as url:
        yield url


@pytest.fixture
def database(url: str) -> Iterator[Database]:
    database = Database(url)
    database.migrate()
    yield database
    database.close()


def hand_in(database: Database) -> str:
    submission = Submission(
        id=new_id(), course="c", user="ann", quiz="quiz", question="q", answer="{}", content_digest="d", attempt=1
    )
    with database.write() as session:
        submissions.add(session, submission, None)
        jobs.put(session, "grade", submission.id)
    return submission.id


def state(database: Database, submission_id: str) -> tuple[str, list[str]]:
    with database.read() as session:
        events = submissions.events_after(session, submission_id, 0)
        return session.get_one(Submission, submission_id).status, [event.name for event in events]


def a_worker(database: Database, grade: Judge, lease_s: float = 60.0, tries: int = 3) -> Worker:
    return Worker(database, grade, lambda _: OUR_FAULT, threads=2, lease_s=lease_s, tries=tries, retry_s=0.0)


def test_jobs_are_done_in_order_and_once(database: Database) -> None:
    ids = [hand_in(database) for _ in range(3)]
    graded: list[str] = []

    def grade(submission: Submission) -> Verdict:
        graded.append(submission.id)
        return GOOD

    worker = a_worker(database, grade)
    while worker.do_one():
        pass
    assert graded == ids
    assert state(database, ids[0]) == ("graded", ["queued", "running", "graded"])
    with database.read() as session:
        assert jobs.waiting(session) == 0


def test_many_claimants_share_the_jobs_without_doubling_any(database: Database) -> None:
    for _ in range(20):
        hand_in(database)

    def take_all(_: int) -> list[str]:
        mine: list[str] = []
        while True:
            with database.write() as session:
                claimed = jobs.claim(session, 60.0)
            if claimed is None:
                return mine
            mine.append(claimed.subject)

    with ThreadPoolExecutor(4) as pool:
        taken = [subject for mine in pool.map(take_all, range(4)) for subject in mine]
    assert len(taken) == len(set(taken)) == 20


def test_a_lease_that_ran_out_is_taken_again_and_the_late_worker_keeps_nothing(database: Database) -> None:
    submission_id = hand_in(database)
    with database.write() as session:
        dead = jobs.claim(session, lease_s=0.05)
    assert dead is not None
    with database.write() as session:
        assert jobs.claim(session, 60.0) is None
    time.sleep(0.1)
    worker = a_worker(database, lambda _: GOOD)
    assert worker.do_one()
    with database.write() as session:
        assert not jobs.finish(session, dead)
        assert not jobs.put_back(session, dead, 0.0, tried=True)
    assert state(database, submission_id)[0] == "graded"


def test_a_job_that_its_worker_gave_back_in_good_order_has_all_its_tries(database: Database) -> None:
    hand_in(database)
    for tried, tries in ((False, 1), (False, 1), (True, 1), (True, 2)):
        with database.write() as session:
            held = jobs.claim(session, 60.0)
            assert held is not None
            assert held.tries == tries
            assert jobs.put_back(session, held, 0.0, tried=tried)


def test_a_renewed_lease_is_not_taken(database: Database) -> None:
    hand_in(database)
    with database.write() as session:
        claimed = jobs.claim(session, lease_s=0.05)
        assert claimed is not None
        jobs.renew(session, [claimed], 60.0)
    time.sleep(0.1)
    with database.write() as session:
        assert jobs.claim(session, 60.0) is None


def test_a_fault_of_ours_is_retried_and_then_costs_no_attempt(database: Database) -> None:
    submission_id = hand_in(database)
    calls: list[str] = []

    def grade(submission: Submission) -> Verdict:
        calls.append(submission.id)
        if len(calls) == 1:
            raise ZeroDivisionError
        return OUR_FAULT

    worker = a_worker(database, grade)
    while worker.do_one():
        pass
    assert len(calls) == 3
    with database.read() as session:
        submission = session.get_one(Submission, submission_id)
        assert submission.status == "graded"
        assert not submission.uses_attempt
        verdict = submissions.verdicts(session, [submission])[submission_id]
        assert verdict["status"] == "grader_fault"
    expected = ["queued", "running", "queued", "running", "queued", "running", "graded"]
    assert state(database, submission_id)[1] == expected


def test_a_job_that_kills_its_worker_every_time_ends_as_our_fault(database: Database) -> None:
    submission_id = hand_in(database)
    for _ in range(3):
        with database.write() as session:
            assert jobs.claim(session, lease_s=0.0) is not None
        time.sleep(0.002)
    worker = a_worker(database, lambda _: pytest.fail("it must not be run a fourth time"))
    assert worker.do_one()
    with database.read() as session:
        submission = session.get_one(Submission, submission_id)
        assert submissions.verdicts(session, [submission])[submission_id]["status"] == "grader_fault"


def test_a_stopped_worker_gives_back_what_it_was_grading(database: Database, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("grader.worker.GRACE_S", 0.2)
    submission_id = hand_in(database)
    started = time.monotonic()

    def slow(_: Submission) -> Verdict:
        time.sleep(1.0)
        return GOOD

    worker = a_worker(database, slow)
    worker.start()
    while state(database, submission_id)[0] != "running":
        assert time.monotonic() - started < 10
        time.sleep(0.01)
    worker.stop()
    assert state(database, submission_id)[0] == "queued"
    assert a_worker(database, lambda _: GOOD).do_one()
    time.sleep(1.2)
    assert state(database, submission_id) == ("graded", ["queued", "running", "queued", "running", "graded"])


def test_a_worker_killed_in_the_middle_loses_nothing(database: Database, url: str) -> None:
    """A real process, really killed."""
    submission_id = hand_in(database)
    program = (
        "import os, sys\n"
        "from grader.store.database import Database\n"
        "from grader.worker import Worker\n"
        "Worker(Database(sys.argv[1]), lambda _: os.kill(os.getpid(), 9), None, 1, 0.3, 3).do_one()\n"
    )
    done = subprocess.run([sys.executable, "-c", program, url], env={**os.environ}, check=False)
    assert done.returncode == -9
    assert state(database, submission_id)[0] == "running"
    worker = a_worker(database, lambda _: GOOD)
    deadline = time.monotonic() + 10
    while not worker.do_one():
        assert time.monotonic() < deadline
        time.sleep(0.02)
    assert state(database, submission_id) == ("graded", ["queued", "running", "running", "graded"])
