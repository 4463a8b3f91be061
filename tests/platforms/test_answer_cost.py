"""What webhooks and learning platforms cost a plain answer: nothing that a student could notice."""

import json
import time
from collections.abc import Collection, Iterator
from dataclasses import replace
from pathlib import Path
from statistics import median
from typing import Any

import httpx
import pytest
from sqlalchemy.orm import Session

from grader.courses.sending import outbox
from grader.courses.sending.outbox import send_scores
from grader.settings import Settings
from grader.store.outbox import ALL
from grader.store.results import LearnerAt
from platforms.receivers import HERE
from platforms.working import database_of
from support.databases import BACKENDS, database_url
from support.sites import QUIZ, Site, open_site, write_content

ROUNDS, ANSWERS = 15, 20
WITHOUT, IDLE, TOLD = ARMS = ("without the outbox", "without destinations", "with a webhook and scores")
IDLE_MAX, TOLD_MAX = 1.3, 2.2
"""CPU time of the server for an answer, over that without the outbox's statement.

Source: three runs on a quiet machine. Idle: 0.90 to 0.94 (SQLite), 0.88 to 0.95 (PostgreSQL); a busy machine has shown
1.19. Told: 1.35 to 1.39 (SQLite), 1.70 to 1.72 (PostgreSQL). A margin of a tenth for the smaller one, of a quarter for
the larger one.
"""


def wide_quiz(folder: Path) -> Path:
    """Content in which every answer of a learner is the first one to its question: each changes a result."""
    choice = {**QUIZ["questions"][0], "explain": ""}
    questions = [{**choice, "id": f"c{number}"} for number in range((ROUNDS + 1) * ANSWERS)]
    (folder / "quizzes" / "wide.json").write_text(json.dumps({"id": "wide", "title": "Wide", "questions": questions}))
    return folder


@pytest.fixture(params=BACKENDS)
def site(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Site]:
    """A server that delivers nothing: its courses are named as the arms."""
    content = wide_quiz(write_content(tmp_path / "content"))
    many: dict[str, Any] = {"rate_per_s": 10**6, "rate_burst": 10**6, "private_hosts": (HERE,)}
    with (
        database_url(request.param, tmp_path) as url,
        open_site(Settings(content=content, data=tmp_path, database_url=url, workers=0, **many)) as site,
    ):
        yield site


def server_cpu_s(client: httpx.Client, first: int) -> float:
    """The CPU time of an answer in the threads of the server [s]; the client is in this one."""
    began = time.process_time() - time.thread_time()
    for number in range(first, first + ANSWERS):
        body = {"quiz": "wide", "question": f"c{number}", "answer": 1}
        assert client.post("/api/v1/submissions", json=body).status_code == 201
    return (time.process_time() - time.thread_time() - began) / ANSWERS


@pytest.mark.cost
def test_a_plain_answer_costs_hardly_more_for_the_outbox(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    noted = outbox.note

    def note(session: Session, changed: Collection[LearnerAt], only: str = ALL) -> None:
        if all(one.course != WITHOUT for one in changed):
            noted(session, changed, only)

    monkeypatch.setattr(outbox, "note", note)
    teacher = replace(site, course=TOLD).client("tina", "instructor")
    assert teacher.post("/api/v1/webhooks", json={"url": f"http://{HERE}:9/"}).status_code == 201
    with database_of(site).write() as session:
        send_scores(database_of(site), session, TOLD, "wide")
    clients = {arm: replace(site, course=arm).client("ann") for arm in ARMS}
    costs: dict[str, list[float]] = {arm: [] for arm in ARMS}
    for start in range(0, (ROUNDS + 1) * ANSWERS, ANSWERS):
        for arm in ARMS:
            costs[arm].append(server_cpu_s(clients[arm], start))
    ratios = {arm: median(a / b for a, b in zip(costs[arm][1:], costs[WITHOUT][1:], strict=True)) for arm in ARMS}
    print({arm: f"{1000 * median(costs[arm]):.2f} ms, {ratios[arm]:.2f}" for arm in ARMS})
    waiting = teacher.get("/api/v1/deliveries", params={"limit": 100}).json()["items"]
    assert len(waiting) == 100
    assert ratios[IDLE] < IDLE_MAX
    assert ratios[TOLD] < TOLD_MAX
