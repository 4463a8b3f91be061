"""What a learner sees of a quiz, and content that changes while the server runs."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from grader.settings import Settings
from support.databases import database_url
from support.sites import Site
from support.tokens import issue_token

ROOT = Path(__file__).parents[2]
API = "/api/v1"


def strings(value: Any) -> Iterator[str]:
    """Every string and every number of a JSON value, as text."""
    if isinstance(value, dict):
        for item in value.values():
            yield from strings(item)
    elif isinstance(value, list):
        for item in value:
            yield from strings(item)
    elif value is not None and not isinstance(value, bool):
        yield str(value)


def keys(value: Any) -> Iterator[str]:
    if isinstance(value, dict):
        for name, item in value.items():
            yield name
            yield from keys(item)
    elif isinstance(value, list):
        for item in value:
            yield from keys(item)


SECRET = ("answer", "explain", "reference", "tol", "verify", "check", "sim")
"""Keys of a question that no learner may see before the answer."""


def secrets_of(question: dict[str, Any]) -> set[str]:
    """Every text in the hidden part of a question that does not stand in its open part too."""
    hidden = {text for name in SECRET if name in question for text in strings({name: question[name]})}
    shown = {text for name in question.keys() - {*SECRET} for text in strings(question[name])}
    return {text for text in hidden if len(text) > 3} - shown


@pytest.mark.slow
def test_no_secret_of_the_shipped_content_reaches_a_learner(open_site_with: Callable[..., Any]) -> None:
    ann = open_site_with(content=ROOT).client("ann")
    walked = 0
    for item in ann.get(f"{API}/quizzes").json()["items"]:
        quiz = ann.get(f"{API}/quizzes/{item['id']}").json()
        told = set(strings(quiz["questions"]))
        assert not {*SECRET, "entry_cases", "setup", "apply", "expr", "run", "xml"} & set(keys(quiz["questions"]))
        raw = json.loads(next((ROOT / "quizzes").glob(f"{item['id']}.json")).read_text())
        for question in raw.get("questions", ()):
            secrets = secrets_of(question)
            walked += len(secrets)
            assert not secrets & told
            assert not [text for text in secrets if len(text) > 20 and any(text in shown for shown in told)]
    assert walked > 30


def test_the_list_names_every_quiz(ann: httpx.Client) -> None:
    listed = ann.get(f"{API}/quizzes").json()
    quiz = {"id": "small", "title": "A small quiz", "questions": 4, "points": 4.0, "opens": None, "due": None}
    assert listed["items"] == [quiz]
    assert listed["next_cursor"] is None


def test_a_quiz_says_how_many_attempts_are_used(ann: httpx.Client, bob: httpx.Client) -> None:
    for answer in ("6 ms", "5 kg"):
        ann.post(f"{API}/submissions", json={"quiz": "small", "question": "q2", "answer": answer})

    def used(client: httpx.Client) -> list[int]:
        return [question["attempts_used"] for question in client.get(f"{API}/quizzes/small").json()["questions"]]

    assert used(ann) == [0, 1, 0, 0]
    assert used(bob) == [0, 0, 0, 0]


def retitle(content: Path, title: str) -> None:
    path = content / "quizzes" / "small.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"title": title}))


@pytest.mark.slow
def test_content_is_loaded_again_on_request(open_site_with: Callable[..., Any], content: Path) -> None:
    site = open_site_with()
    teacher, ann = site.client("tina", "instructor"), site.client("ann")
    before = ann.post(f"{API}/submissions", json={"quiz": "small", "question": "q1", "answer": 1}).json()
    retitle(content, "Another title")
    assert teacher.post(f"{API}/content:reload").json()["quizzes"][0]["id"] == "small"
    assert ann.get(f"{API}/quizzes/small").json()["title"] == "Another title"
    after = ann.post(f"{API}/submissions", json={"quiz": "small", "question": "q1", "answer": 1}).json()
    digests = [one["verdict"]["content_digest"] for one in (before, after)]
    assert digests[0] != digests[1]
    kept = ann.get(f"{API}/submissions/{before['id']}").json()["verdict"]["content_digest"]
    assert kept == digests[0]


def test_faulty_content_is_refused_as_a_whole_and_the_old_one_stays(
    open_site_with: Callable[..., Any], content: Path
) -> None:
    site = open_site_with()
    teacher = site.client("tina", "instructor")
    retitle(content, "Another title")
    (content / "quizzes" / "bad.json").write_text("{")
    (content / "quizzes" / "worse.json").write_text('{"id": "worse", "title": "x", "questoins": []}')
    refused = teacher.post(f"{API}/content:reload")
    assert refused.status_code == 422
    assert refused.headers["content-type"] == "application/problem+json"
    faults = refused.json()["faults"]
    assert {fault["file"] for fault in faults} == {"quizzes/bad.json", "quizzes/worse.json"}
    assert all(fault["why"] for fault in faults)
    assert teacher.get(f"{API}/quizzes/small").json()["title"] == "A small quiz"


def until(holds: Callable[[], bool], seconds: float = 40.0) -> None:
    deadline = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < deadline
        time.sleep(0.05)


def test_the_server_as_a_program(content: Path, tmp_path: Path) -> None:
    """It prints its addresses and the state of the jail; SIGHUP loads the content again; SIGTERM ends it."""
    data = tmp_path / "data"
    environment = {**os.environ, "GRADER_CONTENT": str(content), "GRADER_WORKERS": "1"}
    command = [str(Path(sys.executable).parent / "grader"), "serve", "--port", "0", "--data", str(data)]
    with subprocess.Popen(
        command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as server:
        try:
            assert server.stdout is not None
            student, instructor, jail = (server.stdout.readline() for _ in range(3))
            assert re.fullmatch(r"Jail: +tier T[012], (\d+) of \1 attacks held\n", jail)
            origin = student.split()[-1].rstrip("/")
            assert f"{origin}/signin?code=gri_" in instructor
            token = issue_token(Settings(content=content, data=data), "ann", "student", None)
            with httpx.Client(base_url=origin, headers={"Authorization": f"Bearer {token}"}) as ann:
                retitle(content, "After the signal")
                server.send_signal(signal.SIGHUP)
                until(lambda: ann.get(f"{API}/quizzes/small").json()["title"] == "After the signal")
                (content / "quizzes" / "small.json").write_text("{")
                server.send_signal(signal.SIGHUP)
                time.sleep(0.5)
                assert ann.get(f"{API}/quizzes/small").json()["title"] == "After the signal"
        finally:
            server.terminate()
        _, log = server.communicate(timeout=30)
    assert "content refused; the old one stays" in log
    assert token.split("_")[2] not in log


@pytest.mark.parametrize("database", ["sqlite", "postgresql"])
def test_a_server_that_refuses_its_content_leaves_nothing_behind(content: Path, tmp_path: Path, database: str) -> None:
    """Its grading processes have begun before the content is read. On PostgreSQL it has two processes."""
    (content / "quizzes" / "small.json").write_text("{")
    (tmp_path / "tmp").mkdir()
    command = [str(Path(sys.executable).parent / "grader"), "serve", "--port", "0", "--data", str(tmp_path / "data")]
    with database_url(database, tmp_path) as url:
        chosen = {"CONTENT": content, "DATABASE_URL": url, "WORKERS": 1, "PROCESSES": 1 if database == "sqlite" else 2}
        environment = {**os.environ, **{f"GRADER_{name}": str(value) for name, value in chosen.items()}}
        environment["TMPDIR"] = str(tmp_path / "tmp")
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 2
    assert "quizzes/small.json" in done.stderr
    assert "Not started" in done.stderr
    assert list((tmp_path / "tmp").iterdir()) == []


@pytest.mark.parametrize("path", ["/healthz", "/metrics", "/openapi.json", "/"])
def test_health_and_openapi_need_no_token(nobody: httpx.Client, path: str) -> None:
    assert nobody.get(path).status_code == 200


def test_every_route_of_the_api_is_described_with_its_refusals(nobody: httpx.Client) -> None:
    paths = nobody.get("/openapi.json").json()["paths"]
    assert {
        f"{API}/quizzes",
        f"{API}/quizzes/{{quiz_id}}",
        f"{API}/submissions",
        f"{API}/submissions/{{submission_id}}",
        f"{API}/submissions/{{submission_id}}/events",
        f"{API}/answers:validate",
        f"{API}/labs:run",
        f"{API}/content:reload",
        "/healthz",
        "/readyz",
    } <= paths.keys()
    for path, operations in paths.items():
        for operation in operations.values():
            refusals = {status: one for status, one in operation["responses"].items() if status >= "400"}
            assert path in ("/healthz", "/readyz") or "401" in refusals
            assert all(list(refusal["content"]) == ["application/problem+json"] for refusal in refusals.values())


def test_a_body_of_many_errors_lists_the_first_twenty(site: Site) -> None:
    refused = site.client("tina", "instructor").post("/api/v1/invitations", json={"names": [1] * 50})
    assert refused.status_code == 422
    assert len(refused.json()["errors"]) == 20


def test_of_many_unknown_keys_the_first_is_named(ann: httpx.Client) -> None:
    body = {"quiz": "small", "question": "q1", "answer": 1, **{f"k{n}": 1 for n in range(1000)}}
    refused = ann.post("/api/v1/submissions", json=body)
    assert refused.status_code == 422
    assert [error["at"] for error in refused.json()["errors"]] == [["body", "k0"]]


def test_a_long_list_is_refused_before_its_entries(site: Site) -> None:
    refused = site.client("tina", "instructor").post("/api/v1/invitations", json={"names": [1] * 1001})
    assert refused.status_code == 422
    assert [error["why"] for error in refused.json()["errors"]] == ["names has more than 1000 entries"]
