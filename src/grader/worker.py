"""The worker of a server or of `grader worker`: the job of grading a submission, in grading processes."""

import json
import signal
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from datetime import timedelta
from functools import partial
from types import MappingProxyType
from typing import Any

import structlog
from prometheus_client import REGISTRY, start_http_server
from sqlalchemy.exc import SQLAlchemyError
from sqlalchemy.orm import Session

from grader.content import Archive
from grader.courses import results
from grader.courses.regrading import JudgeBy, Regrading
from grader.domain.verdict import Status, Verdict
from grader.errors import ContentLost, NotFound, Unprocessable
from grader.grading_process import Graders, Script
from grader.logs import is_json, log_to_stderr
from grader.monitoring import Monitor
from grader.pipeline import OUR_FAULT, Retries, untold
from grader.queue import jobs
from grader.queue.worker import Outcome, Task, Worker
from grader.settings import Settings
from grader.store import submissions
from grader.store.database import AWAY, Database
from grader.store.pruning import prune
from grader.store.tables import Submission

Judge = Callable[[Submission], Verdict]
TellCase = Callable[[str, int, int], object]
"""Called with a submission's id, the number of the case that its script is at, and the number of cases."""
Append = Callable[[Session, Submission, Verdict, str], None]

OTHERS = 4
"""Threads for jobs that wait for others' servers."""

NOTHING_MORE: Mapping[str, Task] = MappingProxyType({})

DAILY, DAY_S = "daily", 86_400.0

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


def tell_learner(database: Database) -> TellCase:
    """Lets those who follow a submission know which case its script is at. A database that is away is ignored."""

    def tell(submission_id: str, case: int, cases: int) -> None:
        with suppress(*AWAY), database.write(hasty=True) as session:
            submissions.tell_case(session, submission_id, case, cases)

    return tell


def judge_with(archive: Archive, graders: Graders, tell: TellCase = untold) -> JudgeBy:
    """Judges a stored submission by the content of a digest, with its recorded seed; scripts in a grading process."""

    def judge(submission: Submission, digest: str) -> Verdict:
        pipeline, answer = archive.pipeline_for(submission.quiz, digest), json.loads(submission.answer)
        parsed = pipeline.read(submission.quiz, submission.question, answer, submission.seed)
        if parsed.is_instant:
            return pipeline.judge(parsed)
        script = Script(submission.quiz, submission.question, answer, parsed.seed)
        return graders.judge(pipeline.library, script, partial(tell, submission.id))

    return judge


def grade_with(archive: Archive, graders: Graders, tell: TellCase = untold) -> Judge:
    """As `judge_with`, by the content that the submission was made against."""
    judge = judge_with(archive, graders, tell)
    return lambda submission: judge(submission, submission.content_digest)


def fault_with(archive: Archive) -> Judge:
    """Makes the verdict on a submission that we failed to grade; worth 0 points if its question is gone."""

    def fault(submission: Submission) -> Verdict:
        try:
            pipeline = archive.pipeline_for(submission.quiz, submission.content_digest)
            return pipeline.fault(submission.quiz, submission.question, submission.answer)
        except (NotFound, ContentLost, SQLAlchemyError):
            return Verdict(status=Status.GRADER_FAULT, points=0.0, max_points=0.0, diagnosis=OUR_FAULT)

    return fault


def append_with(database: Database, archive: Archive) -> Append:
    """Appends a verdict, and counts the learner's result again, under the policies as they are at that moment."""

    def append(session: Session, submission: Submission, verdict: Verdict, cause: str) -> None:
        library = archive.library_now(session, submission.course, submission.quiz)
        results.append_verdict(database, library, session, submission, verdict, cause=cause)

    return append


def graders_of(settings: Settings) -> Graders:
    """The grading processes that the settings describe, not started yet."""
    return Graders(settings.workers, allow_t2=settings.allow_t2)


def worker_of(
    settings: Settings, database: Database, archive: Archive, graders: Graders, more: Mapping[str, Task] = NOTHING_MORE
) -> Worker:
    """The worker that the settings describe; `more` are the tasks of further topics."""
    retries = Retries(settings.tries)
    topics: dict[str, Task] = {
        jobs.GRADE: Grading(
            grade_with(archive, graders, tell_learner(database)), fault_with(archive), append_with(database, archive)
        ),
        jobs.REGRADE: Regrading(database, archive, judge_with(archive, graders), retries),
        jobs.PRUNE: Pruning(database, timedelta(days=settings.prune_days)),
        **more,
    }
    if settings.workers:
        schedule_pruning(database)
    return Worker(database, topics, settings.workers, retries, OTHERS)


def run_worker(
    settings: Settings,
    more: Callable[[Settings, Database, Archive], Mapping[str, Task]],
    ready: Callable[[Mapping[str, Any]], object] = dict,
) -> None:
    """Grades until SIGTERM or SIGINT, with the content that servers keep in the database.

    `more` makes the tasks of further topics; `ready` is called with what the jail told at its start.

    Raises Unprocessable on SQLite.
    """
    log_to_stderr(as_json=is_json(settings.log_format))
    ended = threading.Event()
    database = Database(settings.database, settings.connections)
    if database.is_sqlite:
        raise Unprocessable(
            "A SQLite database is worked on by `grader serve` alone. Set GRADER_WORKERS for more grading processes, "
            "or GRADER_DATABASE_URL to a PostgreSQL database for workers beside the server."
        )
    database.migrate()
    archive = Archive(database)
    with graders_of(settings) as graders:
        worker = worker_of(settings, database, archive, graders, more(settings, database, archive))
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, lambda *_: ended.set())
        signal.signal(signal.SIGHUP, signal.SIG_IGN)  # as for a server: content comes from the database anyway
        worker.start()
        if settings.metrics_port:
            REGISTRY.register(Monitor(database, graders, worker))
            start_http_server(settings.metrics_port, "127.0.0.1")
        ready(graders.jail)
        ended.wait()
        worker.stop()
    database.close()
