"""`kill -9` in the middle of many answers: what was acknowledged is there, once, and the rest may be sent again."""

import os
import signal
import threading
import time
from contextlib import ExitStack
from pathlib import Path

import httpx
import pytest
from sqlalchemy import func, select

from grader.store.engine.database import Database
from grader.store.tables import Submission, VerdictRow
from support.databases import BACKENDS, database_url
from support.queue_kills import client_of, next_server, process_of, settings_on, wait_until_ready

LEARNERS = 4
RUN_S = 0.5


def send(client: httpx.Client, key: str) -> str:
    """The id of the acknowledged answer."""
    body = {"quiz": "1.3-check", "question": "q1", "answer": 1}
    made = client.post("/api/v1/submissions", json=body, headers={"Idempotency-Key": key})
    assert made.status_code == 201, made.text
    return str(made.json()["id"])


@pytest.mark.slow
@pytest.mark.parametrize("backend", BACKENDS)
def test_a_kill_loses_no_acknowledged_answer_and_doubles_none(backend: str, tmp_path: Path) -> None:
    with database_url(backend, tmp_path) as url, ExitStack() as stack:
        settings = settings_on(url, tmp_path, workers=0)
        acknowledged: list[dict[str, str]] = [{} for _ in range(LEARNERS)]
        sent: list[list[str]] = [[] for _ in range(LEARNERS)]
        with process_of("serve", settings) as server:
            wait_until_ready(server, settings)
            clients = [stack.enter_context(client_of(settings, f"user{number}")) for number in range(LEARNERS)]

            def answer(number: int) -> None:
                while True:
                    sent[number].append(f"key-{len(sent[number])}")
                    try:
                        acknowledged[number][sent[number][-1]] = send(clients[number], sent[number][-1])
                    except httpx.TransportError:
                        return

            threads = [threading.Thread(target=answer, args=(number,)) for number in range(LEARNERS)]
            for thread in threads:
                thread.start()
            time.sleep(RUN_S)
            os.kill(server.pid, signal.SIGKILL)
            for thread in threads:
                thread.join(60)
        assert all(acknowledged)
        with next_server(settings):
            for number, client in enumerate(clients):
                for key in sent[number]:
                    made = send(client, key)
                    assert acknowledged[number].setdefault(key, made) == made
        database = Database(url)
        with database.read() as session:
            assert session.scalar(select(func.count()).select_from(Submission)) == sum(map(len, sent))
            verdicts = list(session.scalars(select(func.count(VerdictRow.id)).group_by(VerdictRow.submission_id)))
        database.close()
        assert verdicts == [1] * sum(map(len, sent))
