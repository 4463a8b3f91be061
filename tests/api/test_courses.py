"""A course may have a content folder of its own: every route and page goes by the course of the caller."""

import json
from collections.abc import Callable
from pathlib import Path

import httpx
import pytest

from grader.grading_process import Graders
from grader.worker import worker_of
from sites import Site

API = "/api/v1"


def write(folder: Path, answer: int, quiz: str = "own") -> Path:
    (folder / "quizzes").mkdir(parents=True, exist_ok=True)
    question = {"kind": "numeric", "q": "How many?", "answer": answer, "tol": 0}
    text = json.dumps({"id": quiz, "title": "The course's own quiz", "questions": [question]})
    (folder / "quizzes" / "own.json").write_text(text)
    return folder


@pytest.fixture
def own(tmp_path: Path) -> Path:
    return write(tmp_path / "mechanics", 5)


@pytest.fixture
def site(open_site_with: Callable[..., Site], own: Path) -> Site:
    return open_site_with(courses={"mechanics": own})


def quizzes(client: httpx.Client) -> list[str]:
    return [quiz["id"] for quiz in client.get(f"{API}/quizzes").json()["items"]]


def test_each_course_has_its_own_quizzes(site: Site) -> None:
    ann, bob = site.client("ann", course="mechanics"), site.client("bob")
    assert (quizzes(ann), quizzes(bob)) == (["own"], ["small"])
    assert ann.get(f"{API}/quizzes/small").status_code == bob.get(f"{API}/quizzes/own").status_code == 404
    answer = {"quiz": "own", "question": "q1", "answer": 5}
    assert ann.post(f"{API}/submissions", json=answer).json()["verdict"]["status"] == "correct"
    assert ann.post(f"{API}/answers:validate", json=answer).json()["valid"]
    assert bob.post(f"{API}/submissions", json=answer).status_code == 404
    teacher = site.client("tina", "instructor", "mechanics")
    book = teacher.get(f"{API}/gradebook.csv").text
    assert ("How many" in book or "own" in book, "Which" in book) == (True, False)
    assert teacher.get(f"{API}/quizzes/own/statistics").status_code == 200
    assert teacher.get(f"{API}/quizzes/small/statistics").status_code == 404
    ready = site.anonymous().get("/readyz").json()["checks"]["content"]
    assert (list(ready["quizzes"]), list(ready["courses"]["mechanics"])) == (["small"], ["own"])


def test_a_reload_and_a_regrade_are_the_courses_own(site: Site, own: Path, content: Path) -> None:
    ann, teacher = site.client("ann", course="mechanics"), site.client("tina", "instructor", "mechanics")
    made = ann.post(f"{API}/submissions", json={"quiz": "own", "question": "q1", "answer": 5}).json()["id"]
    write(own, 6)
    (content / "quizzes" / "small.json").write_text("{}")  # another course's fault, which is not in the way
    assert [quiz["id"] for quiz in teacher.post(f"{API}/content:reload").json()["quizzes"]] == ["own"]
    body = {"quiz": "own", "scope": "all", "dry_run": False}
    assert site.client("otto", "instructor").post(f"{API}/regrades", json=body).status_code == 404
    location = teacher.post(f"{API}/regrades", json=body).headers["location"]
    context = site.app.state.context
    worker = worker_of(site.settings, context.database, context.content.archive, Graders(0, allow_t2=False))
    while worker.do_one():
        pass
    assert teacher.get(location).json()["progress"]["outcomes"] == {"changed": 1}
    assert ann.get(f"{API}/submissions/{made}").json()["verdict"]["status"] == "incorrect"
