"""Checks of readiness, and the state of the service as Prometheus metrics. Counters and times are those of a process,
or of all that one `grader serve` has started (`metrics.py`). The state of the queue and the number of workers are those
of the database, and so the same in every process."""

import os
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from prometheus_client import REGISTRY, CollectorRegistry, generate_latest
from prometheus_client.core import GaugeMetricFamily
from prometheus_client.multiprocess import MultiProcessCollector
from prometheus_client.registry import Collector
from sqlalchemy.orm import Session

from grader.domain.verdict import Status
from grader.errors import JailFault, NotReady
from grader.gate.single_call import DEADLINE_S, SingleCall
from grader.grading.content import Contents
from grader.grading.processes import Graders
from grader.metrics import FOLDER, JOBS_FAILED, VERDICTS
from grader.numerics.version import INSTALLED, warn_of_newer
from grader.queue import jobs
from grader.queue.worker import Worker
from grader.store import outbox
from grader.store.engine.database import FREE_BYTES_MIN, FULL, Database, is_away

AWAY = "The database is away, full or read-only."


@dataclass(frozen=True, eq=False)  # a registry keeps it by identity
class Monitor(Collector):
    """The parts of one server or worker that are looked at. The checks raise NotReady."""

    database: Database
    graders: Graders
    worker: Worker

    def __post_init__(self) -> None:
        begin_at_zero()

    def check_database(self) -> dict[str, Any]:
        """Writes to the database, and looks for room: a small write succeeds for a while on a disk that is full."""
        free = self.database.free_bytes
        if free is not None and free < FREE_BYTES_MIN:
            raise NotReady(FULL)
        try:
            self.database.check()
        except Exception as error:
            if is_away(error):
                raise NotReady(AWAY) from error
            raise
        return {"backend": self.database.backend}

    def takes_writes(self) -> bool:
        """Whether the database takes what is to be stored: it is there, not read-only, and its disk has room."""
        try:
            self.check_database()
        except NotReady:
            return False
        return True

    def check_jail(self) -> dict[str, Any]:
        """The jail's tier and its self-test, as the grading processes beside this process told them."""
        try:
            self.graders.revive()
        except JailFault as fault:
            raise NotReady("No grading process can be started; the log says why.") from fault
        return {**self.graders.jail, "workers": self.graders.alive}

    def check_worker(self) -> dict[str, Any]:
        """The workers of the database, here or in `grader worker`: there must be one."""
        try:
            with self.database.read() as session:
                alive = self.worker.alive_on(session)
        except Exception as error:
            if is_away(error):
                raise NotReady(AWAY) from error
            raise
        if not alive:
            raise NotReady("No worker lives: set GRADER_WORKERS to 1 or more, or start `grader worker` on PostgreSQL.")
        return {"alive": alive}

    def workers_alive(self, session: Session) -> int:
        """Counts the live workers of the database."""
        return self.worker.alive_on(session)

    @cached_property
    def stored(self) -> SingleCall[tuple[bool, list[GaugeMetricFamily]]]:
        """Whether the database takes writes, and its metrics: none while it is away."""
        return SingleCall(self._read_stored)

    def _read_stored(self) -> tuple[bool, list[GaugeMetricFamily]]:
        try:
            with self.database.read() as session:
                families = [*queue_families(session, self.worker), outbox_family(session)]
        except Exception as error:
            if not is_away(error):
                raise
            return False, []
        return self.takes_writes(), families

    def collect(self) -> Iterator[GaugeMetricFamily]:
        """The state of the database, the queue and the jail as it is now, for the Prometheus client. A database that
        does not answer within `DEADLINE_S` is away."""
        try:
            is_up, families = self.stored.begin().result(DEADLINE_S)
        except TimeoutError:
            is_up, families = False, []
        yield GaugeMetricFamily("grader_database_up", "Whether the database answers and takes writes.", float(is_up))
        yield from families
        graders = self.graders
        yield GaugeMetricFamily("grader_grading_processes", "Grading processes that run.", graders.alive)
        yield GaugeMetricFamily("grader_grading_processes_busy", "Those with a script in progress.", graders.busy)
        if graders.jail:
            names = ("tier", "integrators")
            jail = GaugeMetricFamily("grader_jail_info", "What the jail told at its start; always 1.", labels=names)
            jail.add_metric([str(graders.jail[name]) for name in names], 1)
            yield jail

    @cached_property
    def shown(self) -> SingleCall[bytes]:
        """The `exposition`, for those who cannot wait for a thread that others may hold."""
        return SingleCall(self.exposition)

    def exposition(self) -> bytes:
        """All metrics in Prometheus' text format: of this process, or of all that `grader serve` has started."""
        own = CollectorRegistry()
        own.register(self)
        return generate_latest(process_registry()) + generate_latest(own)


def begin_at_zero() -> None:
    """Shows counters with alerts before they count: Prometheus sees no increase where a series begins with 1."""
    for status in Status:
        VERDICTS.labels(status)
    for topic in jobs.TOPICS:
        JOBS_FAILED.labels(topic)


def process_registry() -> CollectorRegistry:
    """Returns the counters of this process; their sums over several processes where these share a folder."""
    if FOLDER not in os.environ:
        return REGISTRY
    sums = CollectorRegistry()
    MultiProcessCollector(sums)  # type: ignore[no-untyped-call]
    return sums


def check_mujoco() -> dict[str, Any]:
    """The version of MuJoCo, with a warning where it is newer than tested; that alone is no failure."""
    warning = warn_of_newer()
    return {"version": INSTALLED} | ({"warning": warning} if warning else {})


def check_content(content: Contents) -> dict[str, Any]:
    """The quizzes that are loaded, with their digests: of all courses, then of those with their own."""
    digests = {course: dict(library.digests) for course, library in content.libraries().items()}
    every = digests.pop("")
    return {"quizzes": every} | ({"courses": digests} if digests else {})


def queue_families(session: Session, worker: Worker) -> Iterator[GaugeMetricFamily]:
    """The state of the queue and of the workers, read at once."""
    jobs_by_state = GaugeMetricFamily("grader_queue_jobs", "Jobs that are not done.", labels=("topic", "state"))
    oldest = GaugeMetricFamily("grader_queue_oldest_seconds", "Age of the oldest waiting job.", labels=("topic",))
    for topic, state in jobs.read_state(session).items():
        jobs_by_state.add_metric((topic, "waiting"), state.waiting)
        jobs_by_state.add_metric((topic, "running"), state.running)
        oldest.add_metric((topic,), state.oldest_s or 0.0)
    yield from (jobs_by_state, oldest)
    yield GaugeMetricFamily("grader_workers", "Live workers on the database.", worker.alive_on(session))


def outbox_family(session: Session) -> GaugeMetricFamily:
    """What the outbox still holds, and its dead letters."""
    names = ("kind", "state")
    family = GaugeMetricFamily("grader_outbox_deliveries", "Deliveries that are not sent.", labels=names)
    counts = outbox.count_rows(session)
    for kind in outbox.KINDS:
        for state in (outbox.WAITING, outbox.HELD, outbox.DEAD):
            family.add_metric((kind, state), counts.get((kind, state), 0))
    return family
