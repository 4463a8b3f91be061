"""The content changes between handing in and grading: everybody is graded by the content that they answered."""

import json
import os
import random
import shutil
import signal
import time
from pathlib import Path
from typing import Any

import httpx

from grader.library import load
from grader.settings import Settings
from support.content import PASSED
from support.databases import database_url
from support.queue_kills import (
    client_of,
    kill_grading_process,
    process_of,
    settings_on,
    verdicts_of,
    wait_for,
    wait_until_ready,
)

API = "/api/v1"
QUIZ = "1.3-exercises"
FILE = f"quizzes/{QUIZ}.json"
REPORTS = """from mjcourse import model_path
print("the models are", "new" if "CHANGED" in model_path("pendulum_servo").read_text() else "old")

def largest_stable_timestep(model, integrator):
    return 0.0015
"""
DONE_S = 240.0


def content_of(folder: Path) -> Path:
    """The lesson's exercises in a folder that may change."""
    for name in ("quizzes", "models"):
        shutil.copytree(Settings().content / name, folder / name)
    return folder


def change(content: Path) -> None:
    """Another model, another check of the first exercise, and a new one."""
    quiz = json.loads((content / FILE).read_text())
    first = quiz["questions"][0]
    new = json.loads(json.dumps(first)) | {"id": "servo-again"}
    first["points"] = 6
    first["check"]["cases"] = first["check"]["cases"][:-1]
    quiz["questions"].append(new)
    (content / FILE).write_text(json.dumps(quiz))
    model = content / "models" / "pendulum_servo.xml"
    model.write_text(model.read_text().replace("<worldbody>", "<!-- CHANGED --><worldbody>"))


def hand_in(client: httpx.Client, question: str) -> str:
    body = {"quiz": QUIZ, "question": question, "answer": {"source": REPORTS}}
    made = client.post(f"{API}/submissions", json=body)
    assert made.status_code == 202, made.text
    return str(made.json()["id"])


def regraded(teacher: httpx.Client, location: str) -> dict[str, Any]:
    deadline = time.monotonic() + DONE_S
    while True:
        shown: dict[str, Any] = teacher.get(location).json()
        if shown["status"] not in ("queued", "running"):
            return shown
        assert time.monotonic() < deadline, shown
        time.sleep(0.2)


def told(verdict: dict[str, Any]) -> tuple[str, float, int]:
    models = verdict["stdout"].strip().rpartition(" ")[2]
    return models, verdict["max_points"], len(verdict["findings"])


def test_a_worker_without_the_content_grades_by_that_of_each_submission(tmp_path: Path) -> None:
    """Server and worker are processes of their own; workers are killed in the middle."""
    content = content_of(tmp_path / "content")
    empty = tmp_path / "empty"
    empty.mkdir()
    with database_url("postgresql", tmp_path) as url:
        serving = settings_on(url, tmp_path / "data", workers=0).model_copy(update={"content": content})
        working = settings_on(url, tmp_path / "data", workers=1, tries=20).model_copy(update={"content": empty})
        with (
            process_of("serve", serving) as server,
            client_of(serving, "ann") as ann,
            client_of(serving, "tina", "instructor") as teacher,
        ):
            wait_until_ready(server, serving)
            old = load(content, passed=PASSED).question(QUIZ, "servo-threshold")
            before = hand_in(ann, "servo-threshold")
            change(content)
            assert teacher.post(f"{API}/content:reload").status_code == 200
            after, new = hand_in(ann, "servo-threshold"), hand_in(ann, "servo-again")
            with process_of("worker", working) as worker:
                wait_for(lambda: ann.get(f"{API}/submissions/{before}").json()["status"] != "queued")
                kill_grading_process(worker.pid, random.Random(1))
                time.sleep(1)
                os.kill(worker.pid, signal.SIGKILL)
            with process_of("worker", working) as worker:
                shown = verdicts_of(ann, [before, after, new])
                outcomes = {one: told(shown[one]["verdict"]) for one in shown}
                cases = outcomes[before][2]
                assert old.points == 3
                assert (outcomes[before], outcomes[new]) == (("old", 3, cases), ("new", 3, cases))
                assert outcomes[after][:2] == ("new", 6)
                assert outcomes[after][2] < cases
                digests = {shown[one]["verdict"]["content_digest"] for one in (after, new)}
                assert len(digests) == 1
                assert shown[before]["verdict"]["content_digest"] not in digests
                body = {"quiz": QUIZ, "question": "servo-threshold", "scope": "all", "dry_run": False}
                location = teacher.post(f"{API}/regrades", json=body).headers["location"]
                kill_grading_process(worker.pid, random.Random(2))
                done = regraded(teacher, location)
                assert (done["status"], done["progress"]["outcomes"]) == ("done", {"changed": 1, "same": 1})
                again = json.loads(ann.get(f"{API}/submissions/{before}").text)
                assert (told(again["verdict"]), again["revision"]) == (outcomes[after], 2)
