"""A server that is killed in the middle of a regrade: the next one goes on, and no verdict is doubled."""

import json
import time
from pathlib import Path

import httpx
from sqlalchemy import func, select

from grader.queue import jobs
from grader.store.engine.database import Database
from grader.store.tables import VerdictRow
from support.queue_kills import client_of, next_server, process_of, settings_on, wait_until_ready
from support.sites import QUIZ, write_content

API = "/api/v1"
LEARNERS, ANSWERS = 4, 20
DONE_S = 120.0


def progress(teacher: httpx.Client, location: str) -> tuple[str, int]:
    shown = teacher.get(location, params={"limit": 1}).json()
    return shown["status"], shown["progress"]["done"]


def wait_until_counted(teacher: httpx.Client, location: str, least: int) -> tuple[str, int]:
    """The progress of a regrade once it is done, or has got so far."""
    deadline = time.monotonic() + DONE_S
    while (now := progress(teacher, location))[0] != "done" and now[1] < least:
        assert time.monotonic() < deadline, now
        time.sleep(0.02)
    return now


def test_a_regrade_survives_a_killed_server(url: str, tmp_path: Path) -> None:
    content = write_content(tmp_path / "content")
    settings = settings_on(url, tmp_path / "data", tries=20).model_copy(update={"content": content})
    body = {"quiz": "small", "question": "q1", "answer": 1}
    ids: list[str] = []
    with process_of("serve", settings) as server, client_of(settings, "tina", "instructor") as teacher:
        wait_until_ready(server, settings)
        for number in range(LEARNERS):
            with client_of(settings, f"user{number}") as client:
                ids += [client.post(f"{API}/submissions", json=body).json()["id"] for _ in range(ANSWERS)]
        questions = [{**QUIZ["questions"][0], "answer": 2}, *QUIZ["questions"][1:]]
        (content / "quizzes" / "small.json").write_text(json.dumps({**QUIZ, "questions": questions}))
        assert teacher.post(f"{API}/content:reload").status_code == 200
        asked = {"quiz": "small", "scope": "all", "dry_run": False}
        location = teacher.post(f"{API}/regrades", json=asked).headers["location"]
        wait_until_counted(teacher, location, ANSWERS)
    with next_server(settings), client_of(settings, "tina", "instructor") as teacher:
        now = wait_until_counted(teacher, location, len(ids) + 1)
    assert now == ("done", len(ids))
    database = Database(url)
    with database.read() as session:
        counts = session.execute(select(VerdictRow.submission_id, func.count()).group_by(VerdictRow.submission_id))
        assert {row[0]: row[1] for row in counts} == dict.fromkeys(ids, 2)
        assert jobs.count_jobs(session) == 0
    database.close()
