"""Workers: threads that claim jobs, do them and store what came out."""

import threading
import time
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, ExitStack, nullcontext
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Protocol

import structlog
from sqlalchemy.orm import Session

from grader.domain.run import ignore
from grader.metrics import JOBS_FAILED, RUNNING_S, WAITING_S
from grader.queue import jobs
from grader.queue.jobs import ClaimedJob
from grader.queue.owners import Owner, build_owner, count_workers
from grader.store.engine.database import AWAY, Database
from grader.store.engine.ids import age_s

LOOK_S = 1.0
"""Pause between two looks into the queue where nothing is announced: for delayed jobs and lost signals [s]."""

KEEP_S = 2.0
"""Pause between two looks for jobs whose owner has ended [s]."""

STOP_S = 0.2
"""As `KEEP_S`, while a job is to stop: what `stop_job` ends may not have begun [s]."""

APART = (jobs.DELIVER, jobs.PRUNE)
"""Topics whose jobs wait for others' servers, or take long: with threads of their own they hold up no grading."""

GRACE_S = 5.0
"""How long a stopping worker waits for the jobs in progress [s]."""

log = structlog.get_logger()


@dataclass(frozen=True)
class JobOutcome:
    """What a job came to: `store` is called in the transaction that ends the job. `again`: another try may help."""

    store: Callable[[Session], None]
    again: bool = False


class Task(Protocol):
    """What the jobs of a topic do. Nothing but the worker tries again."""

    def start(self, session: Session, subject: str) -> Any:
        """Records that the job is in progress. Returns what `run` needs; None if nothing is left to be done."""

    def run(self, started: Any) -> JobOutcome:
        """Does the job, outside any transaction. Raising counts as a fault of ours, which is worth another try."""

    def give_up(self, started: Any) -> JobOutcome:
        """What to store after the last try failed. Must not raise."""

    def put_back(self, session: Session, subject: str) -> None:
        """Records that the job waits again."""


class Schedule(Protocol):
    """How often a job is tried, and how long it waits in between."""

    @property
    def tries(self) -> int:
        """The number of tries."""

    def pause_after(self, tried: int) -> float | None:
        """Returns the pause after `tried` failures [s]; None when no try is left."""


class News:
    """Counts the announced jobs of some topics, and wakes the threads that wait for them."""

    def __init__(self) -> None:
        self.count = 0
        self._change = threading.Condition()

    def tell(self) -> None:
        """Makes the idle threads look into the queue at once."""
        with self._change:
            self.count += 1
            self._change.notify_all()

    def wait(self, seen: int) -> None:
        """Waits until there are more than those `seen`, for `LOOK_S` at most."""
        with self._change:
            self._change.wait_for(lambda: self.count != seen, timeout=LOOK_S)


@dataclass
class Worker:
    """Does `threads` jobs at a time, of the topics in `tasks`; of several, one is left to others than a learner whose
    scripts hold the rest. With `others`, so many further threads do the jobs of `APART`, and the first ones leave them
    alone.

    A job that fails, or whose worker dies, goes back to the queue and is tried again as `retries` says. While the
    database is away, the worker waits for it; the outcomes of jobs in progress are stored when it is back, and a lost
    session is no try. `stop_job` is called with the subject of a job that is to stop, again and again until the job has
    an outcome."""

    database: Database
    tasks: Mapping[str, Task]
    threads: int
    retries: Schedule
    others: int = 0
    stop_job: Callable[[str], object] = ignore
    owner: Owner = field(init=False)
    _news: dict[tuple[str, ...], News] = field(default_factory=dict)
    _claiming: threading.Lock = field(default_factory=threading.Lock)
    _stop: threading.Event = field(default_factory=threading.Event)
    _look: threading.Event = field(default_factory=threading.Event)
    _held: dict[str, ClaimedJob] = field(default_factory=dict)
    _threads: list[threading.Thread] = field(default_factory=list)
    _listening: ExitStack = field(default_factory=ExitStack)

    def __post_init__(self) -> None:
        self.owner = build_owner(self.database)

    def start(self) -> None:
        """Starts the threads."""
        self._keep_owner()  # before the first claim: the jobs of an owner without a lock are released
        apart = tuple(topic for topic in self.tasks if topic in APART and self.others)
        first = tuple(topic for topic in self.tasks if topic not in apart)
        # A thread without topics has nothing to claim.
        lanes = [topics for topics in [first] * self.threads + [apart] * self.others if topics]
        self._news = {topics: News() for topics in lanes}
        for topics, news in self._news.items():
            for topic in topics:
                self._listening.enter_context(self.database.signals.listening(jobs.NEWS, news.tell, topic))
        self._listening.enter_context(self.database.signals.listening(jobs.STOPS, self._look.set))
        targets: list[Callable[[], None]] = [self._keep, *(partial(self._work, topics) for topics in lanes)]
        self._threads = [threading.Thread(target=target, daemon=True) for target in targets]
        for thread in self._threads:
            thread.start()

    def wake(self) -> None:
        """Makes the idle threads look into the queue at once."""
        for news in self._news.values():
            news.tell()

    def stop(self) -> None:
        """Claims no more jobs, waits `GRACE_S`, and puts unfinished jobs back into the queue."""
        self._listening.close()
        self._stop.set()
        self._look.set()
        self.wake()
        deadline = time.monotonic() + GRACE_S
        for thread in self._threads:
            thread.join(max(0.0, deadline - time.monotonic()))
        for lease in list(self._held):
            if claimed := self._held.pop(lease, None):
                self._give_back(claimed)
        self.owner.close()

    def _give_back(self, claimed: ClaimedJob) -> None:
        try:
            with self.database.write() as session:
                self._put_back(session, claimed, 0.0, tried=False)
        except Exception:
            log.exception("a job in progress could not be put back; its owner's end releases it")

    def alive_on(self, session: Session) -> int:
        """Returns the number of live workers on the database, in this and all other processes."""
        return int(self.alive) if self.database.is_sqlite else count_workers(session)

    @property
    def alive(self) -> bool:
        """Whether every thread runs."""
        return bool(self._threads) and all(thread.is_alive() for thread in self._threads)

    def do_one(self, topics: tuple[str, ...] | None = None) -> bool:
        """Does the next job, of these topics or, with None, of any that has a task. False if there is none."""
        wanted = tuple(self.tasks) if topics is None else topics
        claimed: ClaimedJob | None = None
        try:
            with self._turn(wanted), self.database.write(hasty=True) as session:  # a lost claim leaves the job waiting
                claimed = jobs.claim(session, self.owner.id, wanted, self.threads - 1 if self.threads > 1 else None)
                if claimed is None:
                    return False
                # Before the commit: what the database calls ours and is not held here counts as lost.
                self._held[claimed.lease] = claimed
                started = self.tasks[claimed.topic].start(session, claimed.subject)
            if claimed.tries == 1 and (waited_s := age_s(claimed.subject)) is not None:
                WAITING_S.labels(claimed.topic).observe(waited_s)
            with RUNNING_S.labels(claimed.topic).time():
                outcome = self._outcome(claimed, started)
            if outcome.again:
                JOBS_FAILED.labels(claimed.topic).inc()
            self._settle(claimed, outcome)
        finally:
            if claimed is not None:
                self._held.pop(claimed.lease, None)
        return True

    def _turn(self, topics: tuple[str, ...]) -> AbstractContextManager[Any]:
        """Lets one thread at a time claim what of a share an owner has only so much of, as `jobs.claim` asks for."""
        is_limited = jobs.DELIVER in topics or (jobs.GRADE in topics and self.threads > 1)
        return self._claiming if is_limited else nullcontext()

    def _outcome(self, claimed: ClaimedJob, started: Any) -> JobOutcome:
        task = self.tasks[claimed.topic]
        if started is None:
            return JobOutcome(lambda _: None)
        if claimed.tries > self.retries.tries:
            log.error("the workers of a job ended at every try", topic=claimed.topic, subject=claimed.subject)
            return task.give_up(started)
        try:
            return task.run(started)
        except Exception:
            log.exception("a job failed", topic=claimed.topic, subject=claimed.subject, tries=claimed.tries)
            return JobOutcome(task.give_up(started).store, again=True)

    def _settle(self, claimed: ClaimedJob, outcome: JobOutcome) -> None:
        if claimed.lease not in self._held:
            return  # put back when the worker stopped
        pause_s = self.retries.pause_after(claimed.tries) if outcome.again else None

        def end(session: Session) -> None:
            if pause_s is not None:
                self._put_back(session, claimed, pause_s, tried=True)
            elif jobs.finish(session, claimed) or self._finish_released(session, claimed):
                outcome.store(session)

        try:
            self._write(end)
        except Exception:
            log.exception("an outcome cannot be stored", topic=claimed.topic, subject=claimed.subject)
            delay_s = LOOK_S * 2 ** min(claimed.tries, 10)
            self._write(lambda session: self._put_back(session, claimed, delay_s, tried=True))

    def _finish_released(self, session: Session, claimed: ClaimedJob) -> bool:
        return jobs.take_back(session, self.owner.id, claimed) and jobs.finish(session, claimed)

    def _put_back(self, session: Session, claimed: ClaimedJob, delay_s: float, *, tried: bool) -> None:
        if jobs.put_back(session, claimed, delay_s, tried=tried):
            self.tasks[claimed.topic].put_back(session, claimed.subject)

    def _write(self, change: Callable[[Session], None]) -> None:
        """Makes a change in a transaction of its own, again and again while the database is away. A change that was
        committed although its answer got lost finds its claim gone, and does nothing."""
        while True:
            try:
                with self.database.write() as session:
                    change(session)
                return
            except AWAY as error:
                log.warning("the database is away", error=type(error).__name__)
                if self._stop.wait(LOOK_S):
                    raise

    def _work(self, topics: tuple[str, ...]) -> None:
        while not self._stop.is_set():
            seen = self._news[topics].count
            try:
                if self.do_one(topics):
                    continue
            except AWAY as error:
                log.warning("the database is away", error=type(error).__name__)
                self._stop.wait(LOOK_S)
            except Exception:
                log.exception("the queue cannot be reached")
                self._stop.wait(LOOK_S)
            self._news[topics].wait(seen)

    def _keep(self) -> None:
        """Keeps this process an owner, releases jobs of owners that ended and lost claims, and stops jobs."""
        pause_s = KEEP_S
        while True:
            self._look.wait(pause_s)
            self._look.clear()
            if self._stop.is_set():
                return
            pause_s = STOP_S if self._keep_owner() else KEEP_S

    def _keep_owner(self) -> bool:
        """Looks once. Returns whether a job is still to stop."""
        try:
            self.owner.keep()
            self._mend_claims()
            return self._stop_asked()
        except AWAY as error:
            log.warning("the database is away", error=type(error).__name__)
        except Exception:
            log.exception("the owner of jobs cannot be kept")
        return False

    def _mend_claims(self) -> None:
        """Releases claims whose commit succeeded although its answer got lost, and takes back jobs in progress that
        were released while the database was out of reach."""
        held = list(self._held.values())
        with self.database.read() as session:
            ours = [lease for owner, lease in jobs.list_owned(session) if owner == self.owner.id]
        lost = [lease for lease in ours if lease not in self._held]
        gone = [claimed for claimed in held if claimed.lease not in ours and claimed.lease in self._held]
        if lost or gone:
            with self.database.write() as session:
                jobs.release(session, lost)
                for claimed in gone:
                    if jobs.take_back(session, self.owner.id, claimed):
                        log.warning("a job was taken back", topic=claimed.topic, subject=claimed.subject)

    def _stop_asked(self) -> bool:
        with self.database.read() as session:
            subjects = jobs.list_asked_to_stop(session, self.owner.id)
        for subject in subjects:
            self.stop_job(subject)
        return bool(subjects)
