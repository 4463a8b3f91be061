"""The worker of a server or of `grader worker`: the job of grading a submission, in grading processes."""

import json
import signal
import threading
from collections.abc import Callable
from dataclasses import dataclass

import structlog
from prometheus_client import REGISTRY, start_http_server
from sqlalchemy.orm import Session

from grader.content import Content
from grader.courses import results
from grader.domain.verdict import Status, Verdict
from grader.errors import NotFound, Unprocessable
from grader.grading_process import Graders, Script
from grader.logs import is_json, log_to_stderr
from grader.monitoring import Monitor
from grader.pipeline import OUR_FAULT, Retries
from grader.queue import jobs
from grader.queue.worker import Outcome, Worker
from grader.settings import Settings
from grader.store import submissions
from grader.store.database import Database
from grader.store.installation import hidden_case_secret
from grader.store.tables import Submission

Judge = Callable[[Submission], Verdict]
Append = Callable[[Session, Submission, Verdict, str], None]

log = structlog.get_logger()


@dataclass(frozen=True)
class Grading:
    """Grades a submission: `grade` judges it, and `fault` makes the verdict after the last failure."""

    grade: Judge
    fault: Judge
    append: Append = submissions.append_verdict
    """Stores a verdict, and the result that follows from it."""

    def start(self, session: Session, subject: str) -> Submission | None:
        """Marks the submission as running, unless it has its verdict."""
        submission = submissions.get(session, subject)
        return None if submission is None or submission.revision else submissions.start(session, subject)

    def run(self, started: Submission) -> Outcome:
        """Judges the submission. The queue tries again after a `grader_fault`."""
        verdict = self.grade(started)
        return self._outcome(started, verdict, again=verdict.status is Status.GRADER_FAULT)

    def give_up(self, started: Submission) -> Outcome:
        """Stores a `grader_fault`, which uses no attempt, after the last try."""
        return self._outcome(started, self.fault(started))

    def put_back(self, session: Session, subject: str) -> None:
        """Marks the submission as queued."""
        submissions.put_back(session, subject)

    def _outcome(self, submission: Submission, verdict: Verdict, again: bool = False) -> Outcome:
        def store(session: Session) -> None:
            # A second verdict is also impossible by UNIQUE(submission_id, revision) and by the submission's version.
            graded = session.get_one(Submission, submission.id)
            if graded.revision == 0:
                self.append(session, graded, verdict, "grading")
                log.info("graded", submission=submission.id, status=verdict.status.value)

        return Outcome(store, again)


def grade_with(content: Content) -> Judge:
    """Judges a stored submission in this process against the current content, with its recorded seed."""

    def grade(submission: Submission) -> Verdict:
        pipeline = content.pipeline
        answer = json.loads(submission.answer)
        return pipeline.judge(pipeline.read(submission.quiz, submission.question, answer, submission.seed))

    return grade


def grade_in(graders: Graders, content: Content) -> Judge:
    """Judges like `grade_with`, in one of the grading processes."""

    def grade(submission: Submission) -> Verdict:
        answer = json.loads(submission.answer)
        script = Script(submission.quiz, submission.question, answer, submission.seed)
        return graders.judge(content.library, script)

    return grade


def fault_with(content: Content) -> Judge:
    """Makes the verdict on a submission that could not be graded; it is out of 0 points if its question is gone."""

    def fault(submission: Submission) -> Verdict:
        try:
            return content.pipeline.fault(submission.quiz, submission.question, submission.answer)
        except NotFound:
            return Verdict(status=Status.GRADER_FAULT, points=0.0, max_points=0.0, diagnosis=OUR_FAULT)

    return fault


def append_with(database: Database, content: Content) -> Append:
    """Appends a verdict, and counts the learner's result again under the current policies."""

    def append(session: Session, submission: Submission, verdict: Verdict, cause: str) -> None:
        results.append_verdict(database, content.library, session, submission, verdict, cause=cause)

    return append


def graders_of(settings: Settings, content: Content) -> Graders:
    """The grading processes that the settings describe, not started yet."""
    return Graders(content.library.root / "models", settings.workers, allow_t2=settings.allow_t2)


def worker_of(settings: Settings, database: Database, content: Content, graders: Graders) -> Worker:
    """The worker that the settings describe."""
    grading = Grading(grade_in(graders, content), fault_with(content), append_with(database, content))
    return Worker(database, {jobs.GRADE: grading}, settings.workers, Retries(settings.tries))


def run_worker(settings: Settings) -> None:
    """Grades until SIGTERM or SIGINT; SIGHUP loads the content again. Raises Unprocessable on SQLite."""
    log_to_stderr(as_json=is_json(settings.log_format))
    ended = threading.Event()
    database = Database(settings.database)
    if database.is_sqlite:
        raise Unprocessable(
            "A SQLite database is worked on by `grader serve` alone. Set GRADER_WORKERS for more grading processes, "
            "or GRADER_DATABASE_URL to a PostgreSQL database for workers beside the server."
        )
    database.migrate()
    content = Content(settings.content, hidden_case_secret(database))
    with graders_of(settings, content) as graders:
        worker = worker_of(settings, database, content, graders)
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, lambda *_: ended.set())
        signal.signal(signal.SIGHUP, lambda *_: threading.Thread(target=content.reload_or_log).start())
        worker.start()
        if settings.metrics_port:
            REGISTRY.register(Monitor(database, content, graders, worker))
            start_http_server(settings.metrics_port, "127.0.0.1")
        ended.wait()
        worker.stop()
    database.close()
