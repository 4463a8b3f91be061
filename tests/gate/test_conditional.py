"""Every read has an ETag and answers 304 to it, and is compressed where that is safe."""

import re
from collections.abc import Callable
from typing import Any

import httpx
import pytest

from grader.api import openapi, routes
from support.sites import Site

API = "/api/v1"
GZIP = {"Accept-Encoding": "gzip"}


def handed_in(client: httpx.Client) -> str:
    response = client.post(f"{API}/submissions", json={"quiz": "small", "question": "q4", "answer": "x"})
    submission_id: str = response.json()["id"]
    return submission_id


def regrade_of(site: Site) -> str:
    body = {"quiz": "small", "question": "q4", "scope": "all"}
    return str(site.client("tina", "instructor").post(f"{API}/regrades", json=body).json()["id"])


def webhook_of(site: Site) -> str:
    client = site.client("tina", "instructor")
    return str(client.post(f"{API}/webhooks", json={"url": "https://1.1.1.1/hook"}).json()["id"])


def on_behalf(site: Site) -> str:
    learner = {"namespace": "campus", "id": "4711"}
    body = {"learner": learner, "quiz": "small", "question": "q4", "answer": "x"}
    return str(site.client("lms", "service").post(f"{API}/lms/submissions", json=body).json()["id"])


MADE = {"regrade": regrade_of, "webhook": webhook_of, "behalf": on_behalf}

READS = {
    "student": ["/me", "/quizzes", "/quizzes/small", "/submissions", "/submissions/{id}", "/submissions/{id}/films",
                "/submissions/{id}/comments"],
    "instructor": [
        "/reviews", "/reviews/disagreements", "/reviews/comments?quiz=small&question=q4", "/submissions/{id}/review",
        "/regrades", "/regrades/{regrade}", "/members", "/invitations", "/tokens", "/course", "/audit",
        "/gradebook.csv", "/quizzes/small/statistics", "/quizzes/small/extensions", "/quizzes/small/policy",
        "/roster.csv", "/roster.zip",
        "/webhooks", "/webhooks/{webhook}", "/deliveries", "/lti/platforms", "/lti/contexts", "/courses",
    ],
    "service": ["/results", "/lms/submissions/{behalf}"],
}  # fmt: skip
BY_ROLE = [(role, path) for role, paths in READS.items() for path in paths]


@pytest.mark.parametrize(("role", "path"), BY_ROLE)
def test_every_read_is_304_to_its_own_etag(site: Site, role: str, path: str) -> None:
    # Platforms belong to the installation, and instructors of the default course administer them.
    client = site.client(f"ann-{role}", role, "default" if path == "/lti/platforms" else None)
    made = handed_in(client if role == "student" else site.client("ann"))
    address = API + path.format(id=made, **{name: make(site) for name, make in MADE.items() if f"{{{name}}}" in path})
    first = client.get(address)
    assert first.status_code == 200, first.text
    tag = first.headers["etag"]
    for known in (tag, f"W/{tag}", f'"other", {tag}', "*"):
        again = client.get(address, headers={"If-None-Match": known})
        assert (again.status_code, again.content, again.headers["etag"]) == (304, b"", tag)
        assert "content-type" not in again.headers
    changed = client.get(address, headers={"If-None-Match": '"other"'})
    assert (changed.status_code, changed.content) == (200, first.content)


@pytest.mark.slow
def test_the_table_of_reads_is_complete() -> None:
    from fastapi import FastAPI

    app = FastAPI(title="test", version="0")
    routes.include_in(app)
    reads = [
        path.removeprefix(API) for method, path, operation in openapi.operations(app.openapi())
        if method == "GET" and path.startswith(API) and "text/event-stream" not in str(operation["responses"])
        and not path.endswith("/kit")  # of exercises, which the small quiz has not: tests/pack/test_kit.py
    ]  # fmt: skip
    tried = {path.partition("?")[0] for _, path in BY_ROLE}
    named = {
        "{quiz_id}": "small", "{submission_id}": "{id}", "{regrade_id}": "{regrade}", "{webhook_id}": "{webhook}"
    }  # fmt: skip
    tried |= {path.replace("{behalf}", "{id}") for path in tried}
    untried = {path for path in reads if re.sub(r"{\w+}", lambda name: named[name[0]], path) not in tried}
    assert not untried, f"add to READS, with the role that may read it: {sorted(untried)}"


@pytest.mark.parametrize("path", ["/", "/?quiz=small", "/static/style.css", "/favicon.ico", "/openapi.json"])
@pytest.mark.slow
def test_pages_and_files_are_304_to_their_own_etag(nobody: httpx.Client, path: str) -> None:
    first = nobody.get(path)
    assert nobody.get(path, headers={"If-None-Match": first.headers["etag"]}).status_code == 304


@pytest.mark.parametrize("path", ["/readyz", "/metrics", "/signin?code=gri_1_2", "/join?code=x"])
def test_what_must_not_be_stored_has_no_etag(nobody: httpx.Client, path: str) -> None:
    response = nobody.get(path, headers={"If-None-Match": "*"})
    assert response.status_code != 304
    assert "etag" not in response.headers


def test_an_etag_changes_with_what_it_names(site: Site, ann: httpx.Client) -> None:
    before = ann.get(f"{API}/quizzes/small").headers["etag"]
    handed_in(ann)
    assert ann.get(f"{API}/quizzes/small", headers={"If-None-Match": before}).status_code == 200


def test_large_answers_are_compressed_on_request(site: Site, ann: httpx.Client) -> None:
    packed = ann.get(f"{API}/quizzes/small", headers=GZIP)
    plain = ann.get(f"{API}/quizzes/small", headers={"Accept-Encoding": "identity"})
    assert packed.headers["content-encoding"] == "gzip"
    assert "content-encoding" not in plain.headers
    assert packed.content == plain.content
    assert packed.headers["vary"] == plain.headers["vary"] == "Accept-Encoding"


def test_streams_of_events_are_never_compressed(site: Site, ann: httpx.Client) -> None:
    done = ann.post(f"{API}/submissions", json={"quiz": "small", "question": "q1", "answer": 1}).json()["id"]
    response = ann.get(f"{API}/submissions/{done}/events", headers=GZIP)
    assert response.headers["content-type"].startswith("text/event-stream")
    assert "content-encoding" not in response.headers
    assert "etag" not in response.headers


@pytest.mark.slow
def test_what_holds_a_secret_is_never_compressed(open_site_with: Callable[..., Any]) -> None:
    site = open_site_with()
    teacher = site.client("tina", "instructor")
    names = [f"learner {number}" for number in range(50)]
    invited = teacher.post(f"{API}/invitations", json={"names": names}, headers=GZIP)
    code = invited.json()["items"][0]["url"].partition("?code=")[2]
    page = site.anonymous().get("/signin", params={"code": code}, headers=GZIP)
    assert code in page.text
    for response in (invited, page):
        assert len(response.content) > 1024
        assert "content-encoding" not in response.headers
