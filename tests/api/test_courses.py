"""A course may have a content folder of its own: every route and page goes by the course of the caller."""

import json
import re
from collections.abc import Callable
from pathlib import Path

import httpx
import pytest

from grader.grading.processes import Graders
from grader.service.worker import build_worker
from support.sites import Site

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


WRITTEN: tuple[dict[str, object], ...] = (
    {},
    {"role": "student"},
    {"points": 0, "comment": "KILROY"},
    {"text": "KILROY", "points": 0},
    {"attempts": 5},
)
"""Bodies of which each route that changes something takes one, or none."""


@pytest.mark.slow
def test_no_id_of_another_course_is_of_use(shared_site: Site) -> None:
    """Every documented route, called with the ids of one course by an instructor of another."""
    teacher = shared_site.client("tina", "instructor", "of tina")
    ann = shared_site.client("ann", course="of tina")
    posts = {
        "tokens": {"user": "zoe", "role": "student"},
        "webhooks": {"url": "https://example.org/hook"},
        "regrades": {"quiz": "small", "scope": "all", "dry_run": True},
    }
    for route, body in posts.items():
        assert teacher.post(f"{API}/{route}", json=body).status_code in (201, 202), route
    answer = {"quiz": "small", "question": "q4", "answer": "Because."}
    assert ann.post(f"{API}/submissions", json=answer).status_code == 201
    lists = ("submissions", "members", "tokens", "webhooks", "regrades", "reviews")

    def held() -> list[list[dict[str, object]]]:
        pages = [teacher.get(f"{API}/{one}").json()["items"] for one in lists]
        return [[{**item, "last_used_at": None} for item in items] for items in pages]

    before = held()
    ids = {str(items[0]["id"]) for items in before}
    assert len(ids) == len(lists) - 1  # the review is that of the submission
    strangers = [
        shared_site.client(f"otto{n}", "instructor", "of otto") for n in range(len(ids))
    ]  # each has a rate limit
    for path, operations in shared_site.app.openapi()["paths"].items():
        own = path.replace("{quiz_id}", "small").replace("{question_id}", "q4")
        for one, stranger in zip(ids, strangers, strict=True) if "{" in own else ():
            url = re.sub(r"\{[^}]*\}", one, own)
            for method in operations:
                for body in [None] if method in ("get", "delete") else WRITTEN:
                    answered = stranger.request(method, url, json=body, headers={"If-Match": "*"})
                    assert answered.status_code in (403, 404, 409, 412, 422), (method, url, body, answered.text)
    assert held() == before


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


@pytest.mark.slow
def test_a_reload_and_a_regrade_are_the_courses_own(site: Site, own: Path, content: Path) -> None:
    ann, teacher = site.client("ann", course="mechanics"), site.client("tina", "instructor", "mechanics")
    made = ann.post(f"{API}/submissions", json={"quiz": "own", "question": "q1", "answer": 5}).json()["id"]
    write(own, 6)
    (content / "quizzes" / "small.json").write_text("{}")  # another course's fault, which is not in the way
    assert [quiz["id"] for quiz in teacher.post(f"{API}/content:reload").json()["quizzes"]] == ["own"]
    body = {"quiz": "own", "scope": "all", "dry_run": False}
    assert site.client("otto", "instructor").post(f"{API}/regrades", json=body).status_code == 404
    location = teacher.post(f"{API}/regrades", json=body).headers["location"]
    services = site.app.state.services
    worker = build_worker(site.settings, services.database, services.content.archive, Graders(0, allow_t2=False))
    while worker.do_one():
        pass
    assert teacher.get(location).json()["progress"]["outcomes"] == {"changed": 1}
    assert ann.get(f"{API}/submissions/{made}").json()["verdict"]["status"] == "incorrect"
