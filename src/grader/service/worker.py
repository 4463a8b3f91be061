"""The worker of a server or of `grader worker`: the job of grading a submission, in grading processes."""

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

from grader.courses.answering import results
from grader.courses.answering.stopping import judge_stopped
from grader.courses.regrading.background import JudgeBy, Regrading
from grader.domain.progress import TrialProgress, ignore_progress
from grader.domain.verdict import Status, Verdict
from grader.errors import ContentLost, NotFound, ScriptStopped, Unprocessable
from grader.gate.monitoring import Monitor
from grader.grading.content import Archive
from grader.grading.pipeline import OUR_FAULT, Retries
from grader.grading.processes import Graders, ScriptJob
from grader.library import PassedChecks
from grader.logs import is_json, log_to_stderr
from grader.queue import jobs
from grader.queue.worker import JobOutcome, Task, Worker
from grader.service.opening import end_start, open_database
from grader.settings import Settings, count_processors
from grader.store import intake, submissions
from grader.store.engine.database import AWAY, Database
from grader.store.tables import Submission
from grader.store.upkeep.pruning import prune

Judge = Callable[[Submission], Verdict]
TellCase = Callable[[str, int, int, TrialProgress | None], object]
"""Called with a submission's id, the number of the case that its script is at, and the number of cases."""
Append = Callable[[Session, Submission, Verdict, str], None]

OTHERS = 4
"""Threads for jobs that wait for others' servers."""

NOTHING_MORE: Mapping[str, Task] = MappingProxyType({})

DAILY, DAY_S = "daily", 86_400.0

log = structlog.get_logger()


@dataclass(frozen=True)
class GradingTask:
    """Grades a submission: `grade` judges it, and `fault` makes the verdict after the last failure."""

    grade: Judge
    fault: Judge
    append: Append = submissions.append_verdict
    """Stores a verdict, and the result that follows from it."""

    def start(self, session: Session, subject: str) -> Submission | None:
        """Marks the submission as running, unless it has its verdict."""
        submission = submissions.get(session, subject)
        return None if submission is None or submission.revision else submissions.start(session, subject)

    def run(self, started: Submission) -> JobOutcome:
        """Judges the submission. The queue tries again after a `grader_fault`."""
        try:
            verdict = self.grade(started)
        except ScriptStopped as stopped:
            return self._outcome(started, judge_stopped(stopped, self.fault(started)), cause=submissions.STOP)
        return self._outcome(started, verdict, again=verdict.status is Status.GRADER_FAULT)

    def give_up(self, started: Submission) -> JobOutcome:
        """Stores a `grader_fault`, which uses no attempt, after the last try."""
        return self._outcome(started, self.fault(started))

    def put_back(self, session: Session, subject: str) -> None:
        """Marks the submission as queued."""
        submissions.put_back(session, subject)

    def _outcome(
        self, submission: Submission, verdict: Verdict, again: bool = False, cause: str = "grading"
    ) -> JobOutcome:
        def store(session: Session) -> None:
            # A second verdict is also impossible by UNIQUE(submission_id, revision) and by the submission's version.
            graded = session.get_one(Submission, submission.id)
            if graded.revision == 0:
                self.append(session, graded, verdict, cause)
                if cause == submissions.STOP and not verdict.status.uses_attempt:
                    intake.forget_key(session, submission.id)
                log.info("graded", submission=submission.id, status=verdict.status.value)

        return JobOutcome(store, again)


@dataclass(frozen=True)
class PruningTask:
    """Deletes what is older than `age`, once a day: the job puts the next one."""

    database: Database
    age: timedelta

    def start(self, _session: Session, subject: str) -> str:
        """Nothing needs to be recorded."""
        return subject

    def run(self, _started: str) -> JobOutcome:
        """Prunes, in transactions of its own."""
        log.info("pruned", rows=prune(self.database, self.age))
        return self.give_up(_started)

    def give_up(self, _started: str) -> JobOutcome:
        """Tries again tomorrow."""
        return JobOutcome(lambda session: jobs.put(session, jobs.PRUNE, DAILY, DAILY, delay_s=DAY_S))

    def put_back(self, _session: Session, _subject: str) -> None:
        """Nothing needs to be recorded."""


def schedule_pruning(database: Database) -> None:
    """Puts the first job that prunes, unless one waits."""
    with database.write() as session:
        database.lock(session, jobs.PRUNE)
        if not jobs.count_jobs(session, jobs.PRUNE):
            jobs.put(session, jobs.PRUNE, DAILY, DAILY)


def make_progress_signal(database: Database) -> TellCase:
    """Lets those who follow a submission know which case its script is at. A database that is away is ignored."""

    def tell(submission_id: str, case: int, cases: int, within: TrialProgress | None) -> None:
        with suppress(*AWAY), database.write(hasty=True) as session:
            submissions.tell_case(session, submission_id, case, cases, within)

    return tell


def make_judge(archive: Archive, graders: Graders, tell: TellCase = ignore_progress) -> JudgeBy:
    """Judges a stored submission by the content of a digest, with its recorded seed; scripts in a grading process."""

    def judge(submission: Submission, digest: str) -> Verdict:
        pipeline, answer = archive.get_pipeline(submission.quiz, digest), archive.carry_over(submission, digest)
        parsed = pipeline.read(submission.quiz, submission.question, answer, submission.seed)
        if parsed.is_instant:
            return pipeline.judge(parsed)
        script = ScriptJob(submission.quiz, submission.question, answer, parsed.seed, submission.id)
        return graders.judge(pipeline.library, script, partial(tell, submission.id))

    return judge


def make_grade(archive: Archive, graders: Graders, tell: TellCase = ignore_progress) -> Judge:
    """As `make_judge`, by the content that the submission was made against."""
    judge = make_judge(archive, graders, tell)
    return lambda submission: judge(submission, submission.content_digest)


def make_fault(archive: Archive) -> Judge:
    """Makes the verdict on a submission that we failed to grade; worth 0 points if its question is gone."""

    def fault(submission: Submission) -> Verdict:
        try:
            pipeline = archive.get_pipeline(submission.quiz, submission.content_digest)
            return pipeline.fault(submission.quiz, submission.question, submission.answer)
        except (NotFound, ContentLost, SQLAlchemyError):
            return Verdict(status=Status.GRADER_FAULT, points=0.0, max_points=0.0, diagnosis=OUR_FAULT)

    return fault


def make_append(database: Database, archive: Archive) -> Append:
    """Appends a verdict, and counts the learner's result again, under the policies as they are at that moment."""

    def append(session: Session, submission: Submission, verdict: Verdict, cause: str) -> None:
        library = archive.current_library(session, submission.course, submission.quiz)
        results.append_verdict(database, library, session, submission, verdict, cause=cause)

    return append


def build_graders(settings: Settings) -> Graders:
    """Returns the grading processes that the settings describe, not started yet."""
    return Graders(settings.workers, allow_t2=settings.allow_t2)


def build_worker(
    settings: Settings, database: Database, archive: Archive, graders: Graders, more: Mapping[str, Task] = NOTHING_MORE
) -> Worker:
    """Returns the worker that the settings describe; `more` are the tasks of further topics."""
    retries = Retries(settings.tries)
    topics: dict[str, Task] = {
        jobs.GRADE: GradingTask(
            make_grade(archive, graders, make_progress_signal(database)),
            make_fault(archive),
            make_append(database, archive),
        ),
        jobs.REGRADE: Regrading(database, archive, make_judge(archive, graders), retries),
        jobs.PRUNE: PruningTask(database, timedelta(days=settings.prune_days)),
        **more,
    }
    if settings.workers:
        schedule_pruning(database)
    return Worker(database, topics, settings.workers, retries, OTHERS, graders.stop)


def open_metrics(port: int) -> None:
    """Shows the metrics of this process on 127.0.0.1. Raises Unprocessable where the port cannot be opened."""
    try:
        start_http_server(port, "127.0.0.1")
    except OSError as error:
        why = f"port {port} of 127.0.0.1 cannot be opened ({error.strerror or error})"
        raise Unprocessable(f"GRADER_METRICS_PORT: {why}: choose another, one for each worker.") from error


def run_worker(
    settings: Settings,
    more: Callable[[Settings, Database, Archive], Mapping[str, Task]],
    ready: Callable[[Mapping[str, Any]], object] = dict,
) -> None:
    """Grades until SIGTERM or SIGINT, with the content that servers keep in the database, and with one process for each
    processor where the settings say 0. `more` makes the tasks of further topics; `ready` is called with what the jail
    told at its start. Raises Unprocessable on SQLite, and where its metrics have no port."""
    log_to_stderr(as_json=is_json(settings.log_format))
    ended = threading.Event()
    if settings.database_url is None or settings.database_url.startswith("sqlite"):
        raise Unprocessable(
            "A SQLite database is worked on by `grader serve` alone. Set GRADER_WORKERS for more grading processes, "
            "or GRADER_DATABASE_URL to a PostgreSQL database for workers beside the server."
        )
    if not settings.workers:  # of a file that a server reads as well, which grades nothing
        settings = settings.model_copy(update={"workers": count_processors()})
    database = open_database(settings)
    if settings.metrics_port:
        open_metrics(settings.metrics_port)
    archive = Archive(database, PassedChecks(settings.cache))
    with build_graders(settings) as graders:
        worker = build_worker(settings, database, archive, graders, more(settings, database, archive))
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, lambda *_: ended.set())
        signal.signal(signal.SIGHUP, signal.SIG_IGN)  # as for a server: content comes from the database anyway
        end_start()
        worker.start()
        if settings.metrics_port:
            REGISTRY.register(Monitor(database, graders, worker))
        ready(graders.jail)
        ended.wait()
        worker.stop()
    database.close()
