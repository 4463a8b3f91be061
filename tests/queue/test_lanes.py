"""Jobs that wait for others' servers have threads of their own, and many jobs of one share are put at once."""

import threading
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import select
from sqlalchemy.orm import Session
from structlog.testing import capture_logs

from grader.grading.pipeline import Retries
from grader.queue import jobs
from grader.queue.jobs import JobRow
from grader.queue.worker import JobOutcome, Worker
from grader.store.engine.database import Database
from support.databases import open_database


@dataclass
class Noting:
    """Notes its jobs; each waits for `may_end`."""

    done: list[str] = field(default_factory=list)
    may_end: threading.Event = field(default_factory=threading.Event)

    def start(self, _session: Session, subject: str) -> Any:
        return subject

    def run(self, started: Any) -> JobOutcome:
        assert self.may_end.wait(30)
        self.done.append(started)
        return JobOutcome(lambda _: None)

    give_up = run

    def put_back(self, _session: Session, _subject: str) -> None:
        """Nothing."""


class Sleeping(Noting):
    """Of its jobs those that sleep wait for `may_end`."""

    def __init__(self) -> None:
        super().__init__()
        self.begun: list[str] = []

    def run(self, started: Any) -> JobOutcome:
        self.begun.append(started)
        if started.startswith("sleep"):
            return super().run(started)
        self.done.append(started)
        return JobOutcome(lambda _: None)


def test_receivers_that_dawdle_hold_up_no_grading(database: Database) -> None:
    grading, delivering = Noting(), Noting()
    grading.may_end.set()
    worker = Worker(database, {jobs.GRADE: grading, jobs.DELIVER: delivering}, 1, Retries(3), others=2)
    with database.write() as session:
        jobs.put_all(session, jobs.DELIVER, [f"slow{number}" for number in range(4)], share="receiver")
    worker.start()
    try:
        with database.write() as session:
            for number in range(3):
                jobs.put(session, jobs.GRADE, f"script{number}", share=f"learner{number}")
        wait_for(lambda: len(grading.done) == 3)
        assert delivering.done == []
        delivering.may_end.set()
        wait_for(lambda: len(delivering.done) == 4)
    finally:
        delivering.may_end.set()
        worker.stop()


def test_news_wake_the_threads_that_do_such_jobs_alone(tmp_path: Path) -> None:
    """On SQLite: other processes' news, which wake everybody on PostgreSQL, cannot be told from our own."""
    with open_database("sqlite", tmp_path) as database:
        watch_the_lanes(database)


def watch_the_lanes(database: Database) -> None:
    grading, delivering = Noting(), Noting()
    worker = Worker(database, {jobs.GRADE: grading, jobs.DELIVER: delivering}, 1, Retries(3), others=2)
    grading.may_end.set()
    delivering.may_end.set()
    worker.start()
    try:
        first, apart = worker._news[(jobs.GRADE,)], worker._news[(jobs.DELIVER,)]
        with database.write() as session:
            jobs.put(session, jobs.GRADE, "script", share="ann")
        wait_for(lambda: first.count == 1)
        assert apart.count == 0
        with database.write() as session:
            jobs.put_all(session, jobs.DELIVER, ["one", "two"], share="receiver")
        wait_for(lambda: apart.count == 1)
        assert first.count == 1
        wait_for(lambda: grading.done == ["script"] and len(delivering.done) == 2)
    finally:
        worker.stop()


def wait_for(condition: Any) -> None:
    deadline = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.01)


def test_jobs_put_at_once_take_turns_as_if_they_were_put_one_by_one(database: Database) -> None:
    with database.write() as session:
        jobs.put_all(session, jobs.DELIVER, ["a1", "a2", "a3"], share="a")
        jobs.put_all(session, jobs.DELIVER, [], share="nobody")
        jobs.put_all(session, jobs.DELIVER, ["b1", "b2"], share="b")
        jobs.put(session, jobs.DELIVER, "a4", share="a")
        rounds = dict(session.execute(select(JobRow.subject, JobRow.round)).all())
    assert [rounds[f"a{number}"] for number in range(1, 5)] == [0, 1, 2, 3]
    assert rounds["b2"] - rounds["b1"] == 1
    claimed = []
    with database.write() as session:
        while one := jobs.claim(session, 1, (jobs.DELIVER,)):
            claimed.append(one.subject)
            assert jobs.finish(session, one)
    assert len(claimed) == 6
    assert [one for one in claimed if one[0] == "a"] == ["a1", "a2", "a3", "a4"]
    assert claimed.index("b2") < claimed.index("a4")


def test_an_owner_delivers_one_thing_at_a_time_to_a_receiver(database: Database) -> None:
    with database.write() as session:
        jobs.put_all(session, jobs.DELIVER, ["slow1", "slow2"], share="slow")
        jobs.put_all(session, jobs.DELIVER, ["fast1"], share="fast")
        jobs.put_all(session, jobs.GRADE, ["script1", "script2"], share="slow")
        first, second, third = (jobs.claim(session, 1, (jobs.DELIVER, jobs.PRUNE)) for _ in range(3))
        assert {first and first.subject, second and second.subject, third} == {"slow1", "fast1", None}
        other = jobs.claim(session, 2, (jobs.DELIVER,))
        assert other is not None
        assert other.subject == "slow2"
        scripts = [jobs.claim(session, 1, (jobs.GRADE, jobs.DELIVER)) for _ in range(3)]
        assert [one and one.subject for one in scripts] == ["script1", "script2", None]


def test_a_learner_has_fewer_scripts_in_progress_than_there_are_threads(database: Database) -> None:
    with database.write() as session:
        jobs.put_all(session, jobs.GRADE, ["s1", "s2", "s3"], share="sleeper")
        jobs.put_all(session, jobs.DELIVER, ["d1", "d2"], share="sleeper")
        topics = (jobs.GRADE, jobs.DELIVER)
        held = [jobs.claim(session, 1, topics, 2) for _ in range(4)]
        assert [one and one.subject for one in held] == ["s1", "s2", "d1", None]
        jobs.put(session, jobs.GRADE, "other", share="somebody")
        assert [one and one.subject for one in (jobs.claim(session, 1, topics, 2) for _ in range(2))] == ["other", None]
        assert jobs.claim(session, 2, (jobs.GRADE,), 2) is not None  # another worker has threads of its own
        assert held[0] is not None and jobs.finish(session, held[0])
        assert jobs.claim(session, 1, (jobs.GRADE,), 2) is None  # the other worker's was the last
        jobs.put(session, jobs.GRADE, "s4", share="sleeper")
        again = jobs.claim(session, 1, (jobs.GRADE,), 2)
        assert again is not None and again.subject == "s4"


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_scripts_that_sleep_leave_a_thread_to_others(database: Database, threads: int) -> None:
    grading = Sleeping()
    worker = Worker(database, {jobs.GRADE: grading}, threads, Retries(3))
    with database.write() as session:
        jobs.put_all(session, jobs.GRADE, [f"sleep{number}" for number in range(5)], share="sleeper")
    worker.start()
    try:
        wait_for(lambda: len(grading.begun) == max(1, threads - 1))
        with database.write() as session:
            jobs.put(session, jobs.GRADE, "quick", share="somebody")
        if threads > 1:
            wait_for(lambda: grading.done == ["quick"])
            assert len(grading.begun) == threads
        grading.may_end.set()
        wait_for(lambda: len(grading.done) == 6)
    finally:
        grading.may_end.set()
        worker.stop()


def test_a_receiver_that_dawdles_takes_one_thread(database: Database) -> None:
    """So it is where all threads look at the same moment."""
    slow, fast = threading.Event(), Noting()
    fast.may_end.set()

    class Delivering(Noting):
        def run(self, started: Any) -> JobOutcome:
            if started.startswith("slow"):
                self.done.append(started)
                assert slow.wait(30)
                return JobOutcome(lambda _: None)
            return fast.run(started)

    delivering = Delivering()
    with database.write() as session:
        jobs.put_all(session, jobs.DELIVER, [f"slow{number}" for number in range(9)], share="slow")
        jobs.put_all(session, jobs.DELIVER, [f"fast{number}" for number in range(30)], share="fast")
    worker = Worker(database, {jobs.DELIVER: delivering}, 0, Retries(3), others=4)
    worker.start()
    try:
        wait_for(lambda: len(fast.done) == 30)
        assert len(delivering.done) == 1
        slow.set()
        wait_for(lambda: len(delivering.done) == 9)
    finally:
        slow.set()
        worker.stop()


def test_the_jobs_of_a_share_are_delayed_together(database: Database) -> None:
    with database.write() as session:
        jobs.put_all(session, jobs.DELIVER, ["a1", "a2"], share="a")
        jobs.put(session, jobs.DELIVER, "a3", share="a", delay_s=1000.0)
        jobs.put(session, jobs.DELIVER, "b1", share="b")
        jobs.delay(session, jobs.DELIVER, "a", 60.0)
        wait_s = JobRow.due_at - jobs.Clock()
        waits = dict(session.execute(select(JobRow.subject, wait_s)).all())
        assert [round(waits[name] or 0.0, -1) for name in ("a1", "a2", "a3", "b1")] == [60.0, 60.0, 1000.0, 0.0]
        one = jobs.claim(session, 1, (jobs.DELIVER,))
        assert one is not None
        assert one.subject == "b1"


def test_a_claim_leaves_other_topics_alone(database: Database) -> None:
    with database.write() as session:
        for topic in jobs.TOPICS:
            jobs.put(session, topic, topic, share="one")
        claims = [jobs.claim(session, 1, topics) for topics in ((jobs.DELIVER, jobs.PRUNE), (jobs.GRADE,))]
        assert [claim and claim.topic for claim in claims] == [jobs.DELIVER, jobs.GRADE]


def test_a_claim_of_no_topics_finds_nothing(database: Database) -> None:
    with database.write() as session:
        jobs.put(session, jobs.GRADE, "script", share="ann")
        assert jobs.claim(session, 1, ()) is None
    assert not Worker(database, {}, 1, Retries(3)).do_one()


def test_only_the_threads_of_their_own_do_jobs_that_wait_for_others(database: Database) -> None:
    """A lane without topics claimed jobs of any, and failed in a worker without tasks."""
    delivering = Noting()
    worker = Worker(database, {jobs.DELIVER: delivering}, threads=2, retries=Retries(3), others=1)
    with database.write() as session:
        jobs.put_all(session, jobs.DELIVER, ["one", "two", "three"], share="receiver")
    worker.start()
    try:
        wait_for(lambda: count_running(database) == 1)
        time.sleep(0.2)
        assert count_running(database) == 1
        delivering.may_end.set()
        wait_for(lambda: len(delivering.done) == 3)
        assert worker.alive
    finally:
        delivering.may_end.set()
        worker.stop()


def test_a_worker_without_tasks_lives_and_logs_no_fault(database: Database) -> None:
    worker = Worker(database, {}, 1, Retries(3))
    with capture_logs() as logs:
        worker.start()
        worker.wake()
        time.sleep(0.2)
        assert worker.alive
        worker.stop()
    assert [log for log in logs if log["log_level"] in ("error", "warning")] == []


def count_running(database: Database) -> int:
    with database.read() as session:
        return len(jobs.list_owned(session))
