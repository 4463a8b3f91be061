"""The primary of two PostgreSQL servers is killed and its replica promoted while learners answer."""

import threading
import time

import httpx
import pytest
from sqlalchemy import select

from grader.settings import Settings
from grader.store.tables import Submission
from support.clusters import replicated
from support.queue_kills import hand_in, verdicts_of, wait_for
from support.sites import open_site

pytestmark = [pytest.mark.postgres, pytest.mark.process, pytest.mark.jail, pytest.mark.slow]

RECOVERED_S = 15.0
"""Answers are taken again within a few seconds after the promotion; a busy machine may take longer [s]."""
SUBMISSIONS = "/api/v1/submissions"


class Learner:
    """Answers one after the other, each until it is acknowledged, with an Idempotency-Key."""

    def __init__(self, client: httpx.Client) -> None:
        self.client, self.acknowledged, self.failed = client, list[str](), 0
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._answer)

    def __enter__(self) -> "Learner":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ending.set()
        self._thread.join()

    def wait_for_more(self, count: int) -> None:
        """Waits until so many more answers are acknowledged."""
        wanted = len(self.acknowledged) + count
        wait_for(lambda: len(self.acknowledged) >= wanted)

    def _answer(self) -> None:
        body = {"quiz": "1.3-check", "question": "q1", "answer": 1}
        while not self._ending.is_set():
            key = {"Idempotency-Key": f"answer-{len(self.acknowledged)}"}
            made = self.client.post(SUBMISSIONS, json=body, headers=key)
            if made.status_code in (200, 201):
                self.acknowledged.append(made.json()["id"])
            else:
                assert made.status_code == 503, made.text
                self.failed += 1


def test_a_promoted_replica_has_every_acknowledged_answer_once() -> None:
    with replicated() as pair:
        settings = Settings(database_url=pair.url, workers=1, rate_per_s=1e5, rate_burst=100_000)
        with open_site(settings) as site:
            with Learner(site.client("ann")) as ann:
                ann.wait_for_more(20)
                pair.kill_primary()
                wait_for(lambda: ann.failed > 0)
                pair.promote()
                promoted_at = time.monotonic()
                ann.wait_for_more(20)
                assert time.monotonic() - promoted_at < RECOVERED_S
            bob = site.client("bob")
            script = hand_in(bob, 0)
            assert verdicts_of(bob, [script])[script]["verdict"]["status"] == "incorrect"
            with site.app.state.services.database.read() as session:
                theirs = select(Submission.id, Submission.attempt).where(Submission.user == "ann")
                stored, attempts = zip(*session.execute(theirs.order_by(Submission.attempt)), strict=True)
        assert sorted(stored) == sorted(ann.acknowledged)
        assert attempts == tuple(range(1, len(stored) + 1))
