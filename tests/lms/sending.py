"""A sender as a process of its own, to be killed: delivers the scores of a database to a simulated platform."""

import json
import sys
import threading
from datetime import timedelta
from typing import Any

from sqlalchemy.orm import Session

from grader.content import Archive
from grader.domain.platform import Platform
from grader.lms.access_tokens import AccessTokens
from grader.lms.delivering import Delivering
from grader.lms.line_items import LineItems
from grader.lms.outgoing import Outgoing
from grader.lms.scores import Scores, ScoreTarget
from grader.pipeline import Retries
from grader.queue import jobs
from grader.queue.worker import Worker
from grader.store.database import Database
from grader.store.outbox import SCORES
from grader.worker import OTHERS
from lms.profiles import Place
from lms.receivers import HERE

PAUSES_S = (0.05,) * 60


def sign(claims: dict[str, Any]) -> str:
    """The claims as they are: a simulated platform reads them."""
    return json.dumps(claims)


def sender_of(database: Database, targets: ScoreTarget) -> Scores:
    """The sender of scores."""
    tokens = AccessTokens(Outgoing([HERE], time_max_s=5.0), sign)
    return Scores(Archive(database).library_now, targets, tokens, LineItems(database, tokens, timedelta(seconds=2)))


def to(platform: Platform, container: str) -> ScoreTarget:
    """Every score to one platform, where learners have the same ids."""

    def target(_session: Session, _course: str, learner: str, quiz: str, question: str) -> Place:
        return Place(platform, container, learner, f"{quiz}/{question}")

    return target


def main(url: str, origin: str, client_id: str, container: str) -> None:
    """Delivers until it is killed."""
    database = Database(url)
    platform = Platform(1, "https://platform.example", client_id, f"{origin}/login", f"{origin}/token", "")
    delivering = Delivering({SCORES: sender_of(database, to(platform, container))}, PAUSES_S)
    Worker(database, {jobs.DELIVER: delivering}, 0, Retries(3), OTHERS).start()
    print("sending", flush=True)
    threading.Event().wait()


if __name__ == "__main__":
    main(*sys.argv[1:])
