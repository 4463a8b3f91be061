"""Grades what waits in the queue: threads that claim a job, walk it through the pipeline and keep its verdict."""

import json
import signal
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import structlog

from grader.api.content import Content
from grader.domain.verdict import Status, Verdict
from grader.errors import NotFound
from grader.pipeline import OUR_FAULT
from grader.queue import jobs
from grader.queue.jobs import Claim
from grader.sandbox.jail import Jail
from grader.settings import Settings, log_to_stderr
from grader.store import submissions
from grader.store.database import Database
from grader.store.tables import Submission

POLL_S = 0.5
"""How soon an idle worker sees what another process queued [s]."""

RETRY_S = 2.0
"""Wait before the second try at a job that failed through our fault; it doubles with every further one [s]."""

GRACE_S = 5.0
"""How long a stopping worker waits for what it is grading [s]."""

Judge = Callable[[Submission], Verdict]

log = structlog.get_logger()


@dataclass
class Worker:
    """`threads` jobs at a time. A job whose worker died is taken again `lease_s` later, `tries` times in all.

    `fault` is the verdict where we failed; it may not fail itself.
    """

    database: Database
    grade: Judge
    fault: Judge
    threads: int
    lease_s: float
    tries: int
    retry_s: float = RETRY_S
    _wake: threading.Event = field(default_factory=threading.Event)
    _stop: threading.Event = field(default_factory=threading.Event)
    _held: dict[int, Claim] = field(default_factory=dict)
    _threads: list[threading.Thread] = field(default_factory=list)

    def start(self) -> None:
        """Begins to work, in threads of its own."""
        targets = [self._work] * self.threads + [self._keep_leases]
        self._threads = [threading.Thread(target=target, daemon=True) for target in targets]
        for thread in self._threads:
            thread.start()

    def wake(self) -> None:
        """There is something to do."""
        self._wake.set()

    def stop(self) -> None:
        """Takes nothing more up; what cannot be finished soon goes back to the queue for another worker."""
        self._stop.set()
        self._wake.set()
        deadline = time.monotonic() + GRACE_S
        for thread in self._threads:
            thread.join(max(0.0, deadline - time.monotonic()))
        for claimed in list(self._held.values()):
            self._put_back(claimed, 0.0, tried=False)

    def do_one(self) -> bool:
        """Grades the oldest job; False where there is none."""
        with self.database.write() as session:
            claimed = jobs.claim(session, self.lease_s)
            if claimed is None:
                return False
            submission = submissions.start(session, claimed.subject)
        self._held[claimed.job_id] = claimed
        try:
            self._settle(claimed, self._verdict(claimed, submission))
        finally:
            del self._held[claimed.job_id]
        return True

    def _verdict(self, claimed: Claim, submission: Submission) -> Verdict:
        if claimed.tries > self.tries:
            log.error("a job killed its worker every time", submission=submission.id)
            return self.fault(submission)
        try:
            return self.grade(submission)
        except Exception:
            log.exception("grading failed", submission=submission.id)
            return self.fault(submission)

    def _settle(self, claimed: Claim, verdict: Verdict) -> None:
        if verdict.status is Status.GRADER_FAULT and claimed.tries < self.tries:
            self._put_back(claimed, self.retry_s * 2 ** (claimed.tries - 1), tried=True)
            return
        with self.database.write() as session:
            if not jobs.finish(session, claimed):
                return
            submission = session.get_one(Submission, claimed.subject)
            submissions.append_verdict(session, submission, verdict, "grading")
        log.info("graded", submission=claimed.subject, status=verdict.status.value, tries=claimed.tries)

    def _put_back(self, claimed: Claim, delay_s: float, *, tried: bool) -> None:
        with self.database.write() as session:
            if jobs.put_back(session, claimed, delay_s, tried=tried):
                submissions.put_back(session, claimed.subject)

    def _work(self) -> None:
        while not self._stop.is_set():
            try:
                if self.do_one():
                    continue
            except Exception:
                log.exception("the queue cannot be reached")
            self._wake.wait(POLL_S)
            self._wake.clear()

    def _keep_leases(self) -> None:
        """A long run keeps its job for as long as this process lives."""
        while not self._stop.wait(self.lease_s / 4):
            held = list(self._held.values())
            if held:
                try:
                    with self.database.write() as session:
                        jobs.renew(session, held, self.lease_s)
                except Exception:
                    log.exception("leases could not be renewed")


def grade_with(content: Content) -> Judge:
    """Grades a submission against the content as it stands then."""

    def grade(submission: Submission) -> Verdict:
        answer = json.loads(submission.answer)
        return content.pipeline.grade(submission.quiz, submission.question, answer, submission.seed)

    return grade


def fault_with(content: Content) -> Judge:
    """What a submission gets that we failed to grade; of a question that is gone, nobody knows its points."""

    def fault(submission: Submission) -> Verdict:
        try:
            return content.pipeline.fault(submission.quiz, submission.question, json.loads(submission.answer))
        except NotFound:
            return Verdict(status=Status.GRADER_FAULT, points=0.0, max_points=0.0, diagnosis=OUR_FAULT)

    return fault


def worker_of(settings: Settings, database: Database, content: Content) -> Worker:
    """A worker as the settings want it."""
    return Worker(
        database, grade_with(content), fault_with(content), settings.workers, settings.lease_s, settings.tries
    )


def run_worker(settings: Settings) -> None:
    """Grades until it is told to end (SIGTERM, SIGINT); SIGHUP loads the content again."""
    log_to_stderr()
    ended = threading.Event()
    content = Content(settings.content)
    database = Database(settings.database)
    database.migrate()
    with Jail(content.library.root / "models", settings.workers, allow_t2=settings.allow_t2) as jail:
        content.run_in(jail.run)
        worker = worker_of(settings, database, content)
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, lambda *_: ended.set())
        signal.signal(signal.SIGHUP, lambda *_: threading.Thread(target=content.reload_or_log).start())
        worker.start()
        ended.wait()
        worker.stop()
    database.close()
