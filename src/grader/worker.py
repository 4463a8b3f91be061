"""The worker of a server or of `grader worker`: the job of grading a submission, in grading processes."""

import json
import signal
import threading
from collections.abc import Callable
from dataclasses import dataclass
from datetime import timedelta

import structlog
from sqlalchemy.orm import Session

from grader.content import Content
from grader.courses import results
from grader.domain.verdict import Status, Verdict
from grader.errors import NotFound, Unprocessable
from grader.grading_process import Graders, Script
from grader.pipeline import OUR_FAULT, Retries
from grader.queue import jobs
from grader.queue.worker import Outcome, Worker
from grader.settings import Settings, log_to_stderr
from grader.store import submissions
from grader.store.database import Database
from grader.store.installation import hidden_case_secret
from grader.store.pruning import prune
from grader.store.tables import Submission

Judge = Callable[[Submission], Verdict]
Append = Callable[[Session, Submission, Verdict, str], None]

DAILY, DAY_S = "daily", 86_400.0

log = structlog.get_logger()


@dataclass(frozen=True)
class Grading:
    """Grades a submission: `grade` judges it, and `fault` makes the verdict after the last failure."""

    grade: Judge
    fault: Judge
    append: Append = submissions.append_verdict
    """Stores a verdict with what follows from it."""

    def start(self, session: Session, subject: str) -> Submission | None:
        """Marks the submission as running, unless it has its verdict."""
        submission = submissions.get(session, subject)
        return None if submission is None or submission.revision else submissions.start(session, subject)

    def run(self, started: Submission) -> Outcome:
        """Judges the submission. A `grader_fault` is worth another try."""
        verdict = self.grade(started)
        return self._outcome(started, verdict, again=verdict.status is Status.GRADER_FAULT)

    def give_up(self, started: Submission) -> Outcome:
        """A verdict that costs the learner nothing."""
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


@dataclass(frozen=True)
class Pruning:
    """Deletes what is older than `age`, once a day: the job puts the next one."""

    database: Database
    age: timedelta

    def start(self, _session: Session, subject: str) -> str:
        """Nothing needs to be recorded."""
        return subject

    def run(self, _started: str) -> Outcome:
        """Prunes, in transactions of its own."""
        log.info("pruned", rows=prune(self.database, self.age))
        return self.give_up(_started)

    def give_up(self, _started: str) -> Outcome:
        """Tries again tomorrow."""
        return Outcome(lambda session: jobs.put(session, jobs.PRUNE, DAILY, DAILY, delay_s=DAY_S))

    def put_back(self, _session: Session, _subject: str) -> None:
        """Nothing needs to be recorded."""


def schedule_pruning(database: Database) -> None:
    """Puts the first job that prunes, unless one waits."""
    with database.write() as session:
        database.lock(session, jobs.PRUNE)
        if not jobs.waiting(session, jobs.PRUNE):
            jobs.put(session, jobs.PRUNE, DAILY, DAILY)


def grade_with(content: Content) -> Judge:
    """Judges a stored submission in this process against the content as it is then, with its recorded seed."""

    def grade(submission: Submission) -> Verdict:
        pipeline = content.pipeline
        answer = json.loads(submission.answer)
        return pipeline.judge(pipeline.read(submission.quiz, submission.question, answer, submission.seed))

    return grade


def grade_in(graders: Graders, content: Content) -> Judge:
    """As `grade_with`, in one of the grading processes."""

    def grade(submission: Submission) -> Verdict:
        answer = json.loads(submission.answer)
        script = Script(submission.quiz, submission.question, answer, submission.seed)
        return graders.judge(content.library, script)

    return grade


def fault_with(content: Content) -> Judge:
    """Makes the verdict on a submission that we failed to grade; worth 0 points if its question is gone."""

    def fault(submission: Submission) -> Verdict:
        try:
            return content.pipeline.fault(submission.quiz, submission.question, submission.answer)
        except NotFound:
            return Verdict(status=Status.GRADER_FAULT, points=0.0, max_points=0.0, diagnosis=OUR_FAULT)

    return fault


def append_with(database: Database, content: Content) -> Append:
    """Appends a verdict, and counts the learner's result again, under the policies as they are at that moment."""

    def append(session: Session, submission: Submission, verdict: Verdict, cause: str) -> None:
        results.append_verdict(database, content.library, session, submission, verdict, cause=cause)

    return append


def graders_of(settings: Settings, content: Content) -> Graders:
    """The grading processes that the settings describe, not started yet."""
    return Graders(content.library.root / "models", settings.workers, allow_t2=settings.allow_t2)


def worker_of(settings: Settings, database: Database, content: Content, graders: Graders) -> Worker:
    """The worker that the settings describe."""
    grading = Grading(grade_in(graders, content), fault_with(content), append_with(database, content))
    pruning = Pruning(database, timedelta(days=settings.prune_days))
    if settings.workers:
        schedule_pruning(database)
    return Worker(database, {jobs.GRADE: grading, jobs.PRUNE: pruning}, settings.workers, Retries(settings.tries))


def run_worker(settings: Settings) -> None:
    """Grades until SIGTERM or SIGINT; SIGHUP loads the content again. Raises Unprocessable on SQLite."""
    log_to_stderr()
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
        ended.wait()
        worker.stop()
    database.close()
