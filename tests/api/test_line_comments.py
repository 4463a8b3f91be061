"""Comments on lines of a script, over HTTP: instructors write them, its learner reads them with the verdict."""

import shutil
from collections.abc import Iterator
from typing import Any

import httpx
import pytest

from grader.settings import Settings
from support.sites import ROOT, Site, open_site, write_content

API = "/api/v1"
SCRIPT = {"source": "def f():\n    return 1\n"}


@pytest.fixture(scope="module")
def shared_site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    """A server with exercises, which nobody grades."""
    folder = tmp_path_factory.mktemp("comments")
    content = write_content(folder / "content")
    shutil.copy(ROOT / "quizzes/1.3-exercises.json", content / "quizzes")
    shutil.copytree(ROOT / "quizzes/starters", content / "quizzes/starters")
    with open_site(Settings(content=content, data=folder / "data", workers=0)) as site:
        yield site


@pytest.fixture
def path(ann: httpx.Client) -> str:
    """The comments on a script of two lines."""
    body = {"quiz": "1.3-exercises", "question": "servo-threshold", "answer": SCRIPT}
    made = ann.post(f"{API}/submissions", json=body)
    return f"{API}/submissions/{made.json()['id']}/comments"


def test_comments_are_listed_line_by_line_and_deleted(path: str, teacher: httpx.Client, ann: httpx.Client) -> None:
    for line, text in [(2, " Which unit? "), (None, "Well named."), (1, "What does it take?")]:
        written = teacher.post(path, json={"line": line, "text": text})
        assert (written.status_code, written.json()["line"], written.json()["text"]) == (201, line, text.strip())
    listed = ann.get(path).json()["items"]
    assert [(one["line"], one["name"]) for one in listed] == [(None, "tina"), (1, "tina"), (2, "tina")]
    assert teacher.get(path).json()["items"] == listed
    assert [teacher.delete(f"{path}/{listed[0]['id']}").status_code for _ in range(2)] == [204, 404]
    assert ann.get(path).json()["items"] == listed[1:]


@pytest.mark.parametrize("body", [{"line": 3, "text": "x"}, {"line": 0, "text": "x"}, {"text": " "}, {"line": "1"}])
def test_a_comment_has_a_text_and_a_line_of_the_script(path: str, teacher: httpx.Client, body: dict[str, Any]) -> None:
    assert teacher.post(path, json=body).status_code == 422
    assert teacher.get(path).json()["items"] == []


def test_others_find_nothing_and_learners_write_nothing(
    path: str, site: Site, ann: httpx.Client, bob: httpx.Client
) -> None:
    elsewhere = site.client("eve", "instructor", "another")
    assert [client.get(path).status_code for client in (bob, elsewhere)] == [404, 404]
    assert ann.post(path, json={"text": "x"}).status_code == 403
    assert elsewhere.post(path, json={"text": "x"}).status_code == 404


def test_a_learner_sees_them_once_the_feedback_is_out(path: str, teacher: httpx.Client, ann: httpx.Client) -> None:
    teacher.post(path, json={"text": "See line 2."})
    policy = f"{API}/quizzes/1.3-exercises/policy"
    now = {"If-Match": "*"}
    teacher.put(policy, json={"feedback": "after_publish"}, headers=now).raise_for_status()
    assert (ann.get(path).json()["items"], len(teacher.get(path).json()["items"])) == ([], 1)
    teacher.put(policy, json={}, headers=now).raise_for_status()
    assert len(ann.get(path).json()["items"]) == 1
