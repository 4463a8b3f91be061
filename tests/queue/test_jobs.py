"""The queue on both databases: a job is done once, whatever happens to its workers."""

import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import pytest
from sqlalchemy import make_url, text, update
from sqlalchemy.exc import OperationalError
from sqlalchemy.orm import Session

from grader.domain.progress import TrialProgress
from grader.domain.verdict import Status, Verdict
from grader.errors import Unprocessable
from grader.grading.content import Archive
from grader.grading.pipeline import Retries
from grader.grading.processes import Graders
from grader.queue import jobs
from grader.queue.jobs import ClaimedJob, JobRow
from grader.queue.owners import PostgresOwner, SqliteOwner, build_owner
from grader.queue.worker import Worker
from grader.service.deliveries import build_deliveries
from grader.service.worker import GradingTask, Judge, make_fault, make_grade, run_worker
from grader.settings import Settings
from grader.store import submissions
from grader.store.engine.database import Database
from grader.store.engine.ids import make_id
from grader.store.events import case_now, events_after
from grader.store.tables import Submission

OTHER = 1
"""An owner of jobs that is not a worker of this test."""

GOOD = Verdict(status=Status.CORRECT, points=1.0, max_points=1.0)
OUR_FAULT = Verdict(status=Status.GRADER_FAULT, points=0.0, max_points=1.0)


def hand_in(database: Database, user: str = "ann") -> str:
    submission = Submission(
        id=make_id(),
        course="c",
        learner=user,
        user=user,
        quiz="quiz",
        question="q",
        answer="{}",
        content_digest="d",
        attempt=1,
    )
    with database.write() as session:
        submissions.add(session, [(submission, None)])
        jobs.put(session, "grade", submission.id, share=user)
    return submission.id


def state(database: Database, submission_id: str) -> tuple[str, list[str]]:
    with database.read() as session:
        events = events_after(session, submission_id, 0)
        return session.get_one(Submission, submission_id).status, [event.name for event in events]


def a_worker(database: Database, grade: Judge, tries: int = 3) -> Worker:
    task = GradingTask(grade, lambda _: OUR_FAULT)
    return Worker(database, {jobs.GRADE: task}, threads=2, retries=Retries(tries, pause_s=0.0))


def claim(database: Database) -> ClaimedJob | None:
    with database.write() as session:
        return jobs.claim(session, OTHER)


def release(database: Database) -> None:
    """As when the owner of the jobs in progress has ended."""
    with database.write() as session:
        jobs.release(session, [lease for _, lease in jobs.list_owned(session)])


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
        assert jobs.count_jobs(session) == 0


def test_the_case_of_a_script_is_told_while_it_runs_and_not_after(database: Database) -> None:
    submission_id = hand_in(database)

    def tell(case: int) -> None:
        with database.write() as session:
            submissions.tell_case(
                session, submission_id, case, 7, TrialProgress(2, 1000, "episode") if case > 2 else None
            )

    def told() -> str | None:
        with database.read() as session:
            at = case_now(session, submission_id)
            return None if at is None else at.words

    def grade(_: Submission) -> Verdict:
        assert told() is None
        tell(1)
        tell(3)
        assert told() == "case 3 of 7, episode 2 of 1000"
        return GOOD

    tell(1)  # it waits: there is nothing to tell
    a_worker(database, grade).do_one()
    tell(4)
    assert state(database, submission_id)[1] == ["queued", "running", "case 1 of 7", "3/7 ep 2/1000", "graded"]
    assert told() is None


def test_a_waiting_job_knows_how_many_are_claimed_before_it(database: Database) -> None:
    owners = {hand_in(database, user): user for user in ("ann", "bob", "cem")} | {hand_in(database, "ann"): "ann"}
    with database.read() as session:
        ahead = {subject: jobs.count_ahead(session, subject, owner) for subject, owner in owners.items()}
    claimed = []
    while True:
        with database.write() as session:
            if (claim := jobs.claim(session, OTHER)) is None:
                break
            claimed.append(claim.subject)
    assert [ahead[subject] for subject in claimed] == [0, 1, 2, 3]
    with database.read() as session:
        assert [jobs.count_ahead(session, *job) for job in owners.items()] == [None] * 4


def test_a_waiting_job_is_withdrawn_and_no_other_one(database: Database) -> None:
    first, second = hand_in(database), hand_in(database)
    with database.write() as session:
        assert not jobs.withdraw(session, jobs.GRADE, first, "bob")
        assert not jobs.withdraw(session, jobs.REGRADE, first, "ann")
        assert [jobs.withdraw(session, jobs.GRADE, first, "ann") for _ in range(2)] == [True, False]
        claimed = jobs.claim(session, OTHER)
        assert claimed is not None
        assert claimed.subject == second
        assert not jobs.withdraw(session, jobs.GRADE, second, "ann")


def test_many_claimants_share_the_jobs_without_doubling_any(database: Database) -> None:
    for _ in range(20):
        hand_in(database)

    def take_all(_: int) -> list[str]:
        mine: list[str] = []
        while True:
            with database.write() as session:
                claimed = jobs.claim(session, OTHER)
            if claimed is None:
                return mine
            mine.append(claimed.subject)

    with ThreadPoolExecutor(4) as pool:
        taken = [subject for mine in pool.map(take_all, range(4)) for subject in mine]
    assert len(taken) == len(set(taken)) == 20


def test_a_released_job_is_claimed_again_and_its_first_owner_keeps_nothing(database: Database) -> None:
    submission_id = hand_in(database)
    dead = claim(database)
    assert dead is not None
    assert claim(database) is None
    release(database)
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
            held = jobs.claim(session, OTHER)
            assert held is not None
            assert held.tries == tries
            assert jobs.put_back(session, held, 0.0, tried=tried)


def test_a_job_in_progress_is_asked_to_stop_once_and_not_in_its_next_try(database: Database) -> None:
    subject = hand_in(database)
    hand_in(database, "bob")
    with database.write() as session:
        assert not jobs.ask_to_stop(session, jobs.GRADE, subject)  # it waits
    for _ in range(2):
        with database.write() as session:
            held = jobs.claim(session, OTHER)
            assert held is not None
            assert held.subject == subject
            assert jobs.list_asked_to_stop(session, OTHER) == []
            assert [jobs.ask_to_stop(session, jobs.GRADE, subject) for _ in range(2)] == [True, False]
            assert jobs.list_asked_to_stop(session, OTHER) == [subject]
            assert jobs.list_asked_to_stop(session, OTHER + 1) == []
            jobs.put_back(session, held, 0.0, tried=True)


def test_two_jobs_for_one_submission_make_one_verdict(database: Database) -> None:
    submission_id = hand_in(database)
    with database.write() as session:
        jobs.put(session, jobs.GRADE, submission_id, share="ann")
    worker = a_worker(database, lambda _: GOOD)
    while worker.do_one():
        pass
    assert state(database, submission_id) == ("graded", ["queued", "running", "graded"])


def test_a_verdict_of_another_worker_is_never_followed_by_a_second(database: Database) -> None:
    """Both grade the same submission at the same time, each under a valid claim."""
    submission_id = hand_in(database)
    with database.write() as session:
        jobs.put(session, jobs.GRADE, submission_id, share="ann")
    late = a_worker(database, lambda _: GOOD)

    def grade(_: Submission) -> Verdict:
        assert late.do_one()
        return OUR_FAULT

    worker = a_worker(database, grade, tries=1)
    assert worker.do_one()
    assert not worker.do_one()
    with database.read() as session:
        submission = session.get_one(Submission, submission_id)
        assert submission.revision == 1
        assert submissions.read_verdicts(session, [submission])[submission_id]["status"] == "correct"


def test_earlier_topics_go_first_and_a_worker_takes_only_topics_that_it_knows(database: Database) -> None:
    with database.write() as session:
        for topic in (jobs.PRUNE, jobs.DELIVER, jobs.GRADE, jobs.REGRADE):
            jobs.put(session, topic, topic, share="ann")
    with database.write() as session:
        taken = [jobs.claim(session, OTHER) for _ in range(4)]
        assert [one.topic for one in taken if one] == list(jobs.TOPICS)
        jobs.put(session, jobs.REGRADE, "regrade", share="ann")
    assert not a_worker(database, lambda _: GOOD).do_one()


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
        verdict = submissions.read_verdicts(session, [submission])[submission_id]
        assert verdict["status"] == "grader_fault"
    expected = ["queued", "running", "queued", "running", "queued", "running", "graded"]
    assert state(database, submission_id)[1] == expected


def test_a_submission_whose_content_is_lost_is_tried_again_and_costs_no_attempt(database: Database) -> None:
    submission_id = hand_in(database)
    archive = Archive(database)
    grading = GradingTask(make_grade(archive, Graders(0, allow_t2=False)), make_fault(archive))
    worker = Worker(database, {jobs.GRADE: grading}, threads=1, retries=Retries(3, pause_s=0.0))
    assert worker.do_one()
    assert state(database, submission_id)[0] == "queued"
    while worker.do_one():
        pass
    assert state(database, submission_id)[1] == [*["queued", "running"] * 3, "graded"]
    with database.read() as session:
        submission = session.get_one(Submission, submission_id)
        assert (submission.outcome, submission.uses_attempt) == ("grader_fault", False)


def test_a_job_that_kills_its_worker_every_time_ends_as_our_fault(database: Database) -> None:
    submission_id = hand_in(database)
    for _ in range(3):
        assert claim(database) is not None
        release(database)
    worker = a_worker(database, lambda _: pytest.fail("it must not be run a fourth time"))
    assert worker.do_one()
    with database.read() as session:
        submission = session.get_one(Submission, submission_id)
        assert submissions.read_verdicts(session, [submission])[submission_id]["status"] == "grader_fault"


def test_a_stopped_worker_gives_back_what_it_was_grading(database: Database, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("grader.queue.worker.GRACE_S", 0.2)
    submission_id = hand_in(database)
    started, stopped = time.monotonic(), threading.Event()

    def slow(_: Submission) -> Verdict:
        stopped.wait(60)
        return GOOD

    worker = a_worker(database, slow)
    worker.start()
    while state(database, submission_id)[0] != "running":
        assert time.monotonic() - started < 10
        time.sleep(0.01)
    worker.stop()
    assert state(database, submission_id)[0] == "queued"
    assert a_worker(database, lambda _: GOOD).do_one()
    stopped.set()
    time.sleep(0.2)
    assert state(database, submission_id) == ("graded", ["queued", "running", "queued", "running", "graded"])


def test_a_clock_that_is_set_back_leaves_no_job_waiting(database: Database) -> None:
    """Rows as they look after the clock has been set back by an hour while one job ran and another was delayed."""
    for user in ("ann", "bob", "eve"):
        hand_in(database, user)
    delayed, running = claim(database), claim(database)
    assert delayed is not None
    assert running is not None
    with database.write() as session:
        assert jobs.put_back(session, delayed, 30.0, tried=True)
    third = claim(database)
    assert third is not None
    assert claim(database) is None
    with database.write() as session:
        times = {"delayed_at": JobRow.delayed_at + 3600, "due_at": JobRow.due_at + 3600}
        session.execute(update(JobRow).where(JobRow.delayed_at.is_not(None)).values(times))
    again = claim(database)
    assert again is not None
    assert again.subject == delayed.subject


def test_a_delayed_job_waits_for_its_time_by_the_databases_clock(database: Database) -> None:
    hand_in(database)
    held = claim(database)
    assert held is not None
    with database.write() as session:
        jobs.put_back(session, held, 0.3, tried=True)
    began = time.monotonic()
    while claim(database) is None:
        assert time.monotonic() - began < 10
        time.sleep(0.01)
    assert time.monotonic() - began > 0.2


def test_an_outcome_is_stored_when_a_lost_database_is_back(database: Database, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("grader.queue.worker.LOOK_S", 0.01)
    submission_id = hand_in(database)
    away = [3]
    finish = jobs.finish

    def lost(session: Session, claimed: ClaimedJob) -> bool:
        away[0] -= 1
        if away[0] > 0:
            raise OperationalError("DELETE", {}, Exception("the server closed the connection"))
        return finish(session, claimed)

    monkeypatch.setattr(jobs, "finish", lost)
    graded: list[str] = []

    def grade(submission: Submission) -> Verdict:
        graded.append(submission.id)
        return GOOD

    assert a_worker(database, grade).do_one()
    assert away == [0]
    assert graded == [submission_id]
    assert state(database, submission_id) == ("graded", ["queued", "running", "graded"])


def test_a_claim_whose_answer_got_lost_is_released(database: Database) -> None:
    """The commit of the claim reached the database, and its worker does not know of it."""
    submission_id = hand_in(database)
    worker = a_worker(database, lambda _: GOOD)
    with database.write() as session:
        jobs.claim(session, worker.owner.id)
    assert not worker.do_one()
    worker.start()
    try:
        wait_until(lambda: state(database, submission_id)[0] == "graded")
    finally:
        worker.stop()


def is_graded(database: Database, submission_id: str) -> bool:
    return state(database, submission_id)[0] == "graded"


def wait_until(done: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 30
    while not done():
        assert time.monotonic() < deadline
        time.sleep(0.02)


KILLED = """
import os, sys
from grader.grading.pipeline import Retries
from grader.store.engine.database import Database
from grader.queue.worker import Worker
from grader.service.worker import GradingTask
worker = Worker(Database(sys.argv[1]), {"grade": GradingTask(lambda _: os.kill(os.getpid(), 9), None)}, 1, Retries())
worker.owner.keep()
worker.do_one()
"""


@pytest.mark.parametrize("rounds", [2])
def test_a_worker_killed_in_the_middle_loses_nothing(database: Database, url: str, rounds: int) -> None:
    """Real processes, really killed: a worker that lives, or the next one that starts, grades what they had."""
    for _ in range(rounds):
        submission_id = hand_in(database)
        done = subprocess.run([sys.executable, "-c", KILLED, url], env={**os.environ}, check=False)
        assert done.returncode == -9
        assert state(database, submission_id)[0] == "running"
        worker = a_worker(database, lambda _: GOOD)
        worker.start()
        try:
            wait_until(partial(is_graded, database, submission_id))
        finally:
            worker.stop()
        assert state(database, submission_id) == ("graded", ["queued", "running", "running", "graded"])


def test_the_jobs_of_a_living_owner_stay_its_own(database: Database, monkeypatch: pytest.MonkeyPatch) -> None:
    if database.is_sqlite:
        with pytest.raises(Unprocessable, match="GRADER_DATABASE_URL"):
            run_worker(Settings(database_url=str(database.engine.url)), build_deliveries)
        return
    monkeypatch.setattr("grader.queue.owners.GRACE_S", 0.0)
    submission_id = hand_in(database)
    first, second = PostgresOwner(database), PostgresOwner(database)
    first.keep()
    with database.write() as session:
        assert jobs.claim(session, first.id) is not None
    second.keep()
    assert claim(database) is None
    first.close()
    second.keep()
    taken = claim(database)
    assert taken is not None
    assert taken.subject == submission_id
    second.close()


def test_an_owner_takes_its_lock_again_after_a_lost_connection(database: Database) -> None:
    if database.is_sqlite:
        assert isinstance(build_owner(database), SqliteOwner)
        return
    hand_in(database)
    owner, other = PostgresOwner(database), PostgresOwner(database)
    owner.keep()
    with database.write() as session:
        jobs.claim(session, owner.id)
        lock = "SELECT pg_terminate_backend(pid) FROM pg_locks WHERE locktype = 'advisory' AND objid = :id AND granted"
        assert session.scalar(text(lock), {"id": owner.id})
    wait_until(lambda: keep_and_look(owner, other))
    owner.close()
    other.close()


def test_an_owner_without_its_lock_has_a_while_to_take_it_again(
    database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    if database.is_sqlite:
        return
    hand_in(database)
    owner, other = PostgresOwner(database), PostgresOwner(database)
    owner.keep()
    with database.write() as session:
        jobs.claim(session, owner.id)
    now_s = [0.0]
    monkeypatch.setattr("grader.queue.owners.time.monotonic", lambda: now_s[0])
    for now_s[0], is_lost, is_released in ((0, 1, 0), (4, 1, 0), (5, 0, 0), (6, 1, 0), (10, 1, 0), (11, 1, 1)):
        owner.close() if is_lost else owner.keep()
        other.keep()
        held = claim(database)
        assert (held is not None) == is_released, now_s
    assert held is not None
    assert held.tries == 2  # its worker may have died of it
    other.close()


def test_a_live_worker_takes_back_what_was_released_and_no_try_is_lost(
    database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As when it was cut off from the database for long; others claim the job more often than it may be tried."""
    submission_id = hand_in(database)
    tries: list[int] = []

    def grade(_: Submission) -> Verdict:
        for is_claimed in (True, True, True, True, False):
            release(database)
            if is_claimed:
                other = claim(database)
                assert other is not None
                tries.append(other.tries)
            worker._mend_claims()
            assert claim(database) is None
        release(database)  # and at the moment of its outcome
        other = claim(database)
        assert other is not None
        late.append(other)
        return GOOD

    late: list[ClaimedJob] = []
    worker = a_worker(database, grade)
    assert worker.do_one()
    assert tries == [2] * 4
    assert state(database, submission_id) == ("graded", ["queued", "running", "graded"])
    with database.write() as session:
        assert not jobs.take_back(session, OTHER, late[0])
        assert jobs.count_jobs(session) == 0


def test_of_two_claims_in_progress_the_earlier_one_holds(database: Database) -> None:
    hand_in(database)
    first = claim(database)
    release(database)
    second = claim(database)
    assert first is not None
    assert second is not None
    with database.write() as session:
        assert jobs.take_back(session, OTHER, first)
        assert not jobs.take_back(session, OTHER + 1, second)
        assert not jobs.finish(session, second)
        assert jobs.put_back(session, first, 0.0, tried=False)
        assert not jobs.take_back(session, OTHER, first)


@pytest.mark.slow
def test_lost_sessions_cost_a_running_script_no_try(url: str, monkeypatch: pytest.MonkeyPatch) -> None:
    if url.startswith("sqlite"):
        return
    monkeypatch.setattr("grader.queue.worker.KEEP_S", 0.2)
    monkeypatch.setattr("grader.queue.worker.LOOK_S", 0.1)
    monkeypatch.setattr("grader.queue.owners.GRACE_S", 1.0)
    named = make_url(url).update_query_dict({"application_name": "grader_cut"}).render_as_string(hide_password=False)
    databases = [Database(named.replace("+", "%20")) for _ in range(2)]
    watching, begun = Database(url), list[str]()

    def grade(submission: Submission) -> Verdict:
        begun.append(submission.id)
        time.sleep(4)
        return GOOD

    workers = [a_worker(database, grade) for database in databases]
    submission_id = hand_in(watching)
    for worker in workers:
        worker.start()
    try:
        wait_until(lambda: bool(begun))
        end = "SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE application_name = 'grader_cut'"
        for _ in range(6):
            time.sleep(0.5)
            with watching.write() as session:
                session.execute(text(end))
        wait_until(partial(is_graded, watching, submission_id))
    finally:
        for worker in workers:
            worker.stop()
        for database in (*databases, watching):
            database.close()
    assert begun == [submission_id]


def keep_and_look(owner: PostgresOwner, other: PostgresOwner) -> bool:
    """Whether the owner holds its lock again, by a try of another to take it."""
    owner.keep()
    with other._database.write() as session:
        return not other._has_ended(session, owner.id)


def test_put_announces_a_job_to_an_idle_worker_in_another_process(database: Database, url: str) -> None:
    """On PostgreSQL the news comes by NOTIFY: the putting database object is not the worker's."""
    if database.is_sqlite:
        other = database
    else:
        other = Database(url)
    worker = a_worker(database, lambda _: GOOD)
    worker.start()
    try:
        time.sleep(0.5)
        (news,) = worker._news.values()
        before = news.count
        hand_in(other)
        wait_until(lambda: news.count > before)
    finally:
        worker.stop()
        if other is not database:
            other.close()
