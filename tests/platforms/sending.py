"""Senders as processes of their own, to be killed: each delivers the scores of a database to a simulated platform."""

import json
import os
import signal
import sys
import time
from datetime import timedelta
from typing import Any

from sqlalchemy.orm import Session

from grader.domain.platform import Platform, ScoreTarget
from grader.grading.content import Archive
from grader.grading.pipeline import Retries
from grader.platforms.sending.access_tokens import AccessTokens
from grader.platforms.sending.delivering import Delivering
from grader.platforms.sending.line_items import LineItems
from grader.platforms.sending.outgoing import Outgoing, load_certificates
from grader.platforms.sending.scores import FindTarget, Scores
from grader.queue import jobs
from grader.queue.worker import Worker
from grader.store.engine.database import Database
from grader.store.outbox import SCORES, Delivery
from platforms.profiles import place
from platforms.receivers import HERE

PAUSES_S = (0.05,) * 60
LOOK_S = 0.2


def sign(claims: dict[str, Any]) -> str:
    """The claims as they are: a simulated platform reads them."""
    return json.dumps(claims)


def sender_of(database: Database, targets: FindTarget) -> Scores:
    """The sender of scores."""
    tokens = AccessTokens(Outgoing([HERE], time_max_s=5.0), sign)
    return Scores(Archive(database).current_library, targets, tokens, LineItems(database, tokens, timedelta(seconds=2)))


def to(platform: Platform, container: str) -> FindTarget:
    """Every score to one platform, where learners have the same ids."""

    def target(_session: Session, row: Delivery) -> ScoreTarget:
        return place(platform, container, row.learner, f"{row.quiz}/{row.question}")

    return target


def send(url: str, origin: str, client_id: str, container: str, threads: int) -> None:
    """Delivers with so many threads until it is killed, or left alone."""
    database = Database(url)
    platform = Platform(1, "https://platform.example", client_id, f"{origin}/login", f"{origin}/token", "")
    delivering = Delivering({SCORES: sender_of(database, to(platform, container))}, PAUSES_S)
    worker = Worker(database, {jobs.DELIVER: delivering}, 0, Retries(3), threads)
    worker.start()
    parent = os.getppid()
    while os.getppid() == parent:  # a worker looks for delayed jobs once a second, and here are many short pauses
        time.sleep(LOOK_S)
        worker.wake()


def main() -> None:
    """Becomes a sender, in a child of its own, for each line of arguments; prints the process id.

    What takes seconds, to import it all, is done once.
    """
    load_certificates()
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    for line in sys.stdin:
        child = os.fork()
        if child == 0:
            os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # for the log
            send(*json.loads(line))
            os._exit(0)  # what started it is gone
        print(child, flush=True)


if __name__ == "__main__":
    main()
