"""Does the jobs of deliveries in a test's own thread."""

import time
from collections.abc import Mapping

from grader.grading.pipeline import Retries
from grader.platforms.sending.delivering import Delivering, Sender
from grader.queue import jobs
from grader.queue.worker import Worker
from grader.store.engine.database import Database
from support.sites import Site

PATIENCE_S = 30.0


def database_of(site: Site) -> Database:
    database: Database = site.app.state.services.database
    return database


def work(
    database: Database, senders: Mapping[str, Sender], pauses_s: tuple[float, ...] = (0.01, 0.01), until_s: float = 1.0
) -> None:
    """Delivers until nothing is due within `until_s`."""
    worker = Worker(database, {jobs.DELIVER: Delivering(senders, pauses_s)}, 1, Retries(3))
    deadline = time.monotonic() + PATIENCE_S
    idle_since = time.monotonic()
    while time.monotonic() < deadline:
        if worker.do_one():
            idle_since = time.monotonic()
            continue
        with database.read() as session:
            if not jobs.count_jobs(session, jobs.DELIVER) or time.monotonic() - idle_since > until_s:
                return
        time.sleep(0.01)
    raise AssertionError("the queue does not get empty")
