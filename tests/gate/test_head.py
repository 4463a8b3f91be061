"""HEAD has the head of what GET answers, and ends at once."""

import httpx
import pytest

from support.sites import Site

API = "/api/v1"


@pytest.mark.parametrize("path", ["/healthz", "/", "/openapi.json", f"{API}/quizzes", f"{API}/nothing"])
def test_head_is_the_head_of_get(ann: httpx.Client, path: str) -> None:
    head, got = ann.head(path), ann.get(path)
    assert (head.status_code, head.content) == (got.status_code, b"")
    changing = {"date", "x-request-id", "set-cookie"}
    assert {*head.headers} - changing == {*got.headers} - changing
    assert head.headers.get("etag") == got.headers.get("etag")


def test_what_the_learner_may_not_read_has_no_head(site: Site) -> None:
    assert site.anonymous().head(f"{API}/quizzes").status_code == 401


def test_the_head_of_a_stream_ends_it(ann: httpx.Client) -> None:
    answer = {"quiz": "small", "question": "q4", "answer": "x"}
    submission = ann.post(f"{API}/submissions", json=answer).json()["id"]
    head = ann.head(f"{API}/submissions/{submission}/events")
    assert head.status_code == 200
    assert head.headers["content-type"].startswith("text/event-stream")
    assert ann.get("/healthz").status_code == 200  # on the same connection
