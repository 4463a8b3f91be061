"""Does the jobs of deliveries in a test's own thread."""

import time
from collections.abc import Mapping
from math import inf

from sqlalchemy import case, func, select

from grader.grading.pipeline import Retries
from grader.platforms.sending.delivering import Delivering, Sender
from grader.queue import jobs
from grader.queue.jobs import JobRow
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
    """Delivers until nothing is due within `until_s` of the last delivery."""
    worker = Worker(database, {jobs.DELIVER: Delivering(senders, pauses_s)}, 1, Retries(3))
    deadline = time.monotonic() + PATIENCE_S
    idle_since = time.monotonic()
    while time.monotonic() < deadline:
        if worker.do_one():
            idle_since = time.monotonic()
            continue
        wait_s = wait_of_next_s(database)
        if time.monotonic() + wait_s > idle_since + until_s:
            return
        time.sleep(max(wait_s, 0.01))
    raise AssertionError("the queue does not get empty")


def wait_of_next_s(database: Database) -> float:
    """In how many seconds the next delivery is due: 0 for one that is due or in progress, infinity without any."""
    wait_s = case((JobRow.due_at.is_(None), 0.0), else_=JobRow.due_at - jobs.Clock())
    with database.read() as session:
        next_s = session.scalar(select(func.min(wait_s)).where(JobRow.topic == jobs.DELIVER))
    return inf if next_s is None else max(0.0, next_s)
