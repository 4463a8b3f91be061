"""Lists that are read whole come in parts of any size, with a link from each part to the next."""

from typing import Any

import httpx
import pytest

from support.sites import Site

API = "/api/v1"
COMMENT = {"quiz": "small", "question": "q3"}


@pytest.fixture
def tina(site: Site) -> httpx.Client:
    """An instructor of a course with three items at least in each list."""
    tina = site.client("tina", "instructor")
    for number in range(3):
        site.client(f"ann-{number}")
        tina.put(f"{API}/quizzes/small/extensions", json={"user": f"ann-{number}", "attempts": 1}).raise_for_status()
        tina.post(f"{API}/reviews/comments", json=COMMENT | {"text": f"Comment {number}."}).raise_for_status()
        tina.post(f"{API}/webhooks", json={"url": f"https://hooks.example/{number}"}).raise_for_status()
        tina.post(f"{API}/invitations", json={"names": [f"new-{number}"]}).raise_for_status()
    return tina


LISTS = [
    "/tokens", "/invitations", "/quizzes/small/extensions", "/reviews/comments?quiz=small&question=q3", "/webhooks"
]  # fmt: skip


@pytest.mark.parametrize("path", LISTS)
def test_the_parts_are_the_list(tina: httpx.Client, path: str) -> None:
    whole = tina.get(f"{API}{path}").json()
    assert (whole["next_cursor"], len(whole["items"]) >= 3) == (None, True)
    parts: list[Any] = []
    url = f"{API}{path}{'&' if '?' in path else '?'}limit=2"
    while url:
        page = tina.get(url)
        assert len(page.json()["items"]) <= 2
        parts += page.json()["items"]
        url = page.links.get("next", {}).get("url", "")
        assert bool(url) == (page.json()["next_cursor"] is not None)
    assert parts == whole["items"]


def test_a_limit_and_a_cursor_that_make_no_sense_are_refused(tina: httpx.Client) -> None:
    assert len(tina.get(f"{API}/quizzes?limit=1").json()["items"]) == 1
    for query in ("limit=0", "limit=101", "limit=x", "cursor=x", "cursor=YXQ6YQ", "cursor=YXQ6LTE"):
        assert tina.get(f"{API}/quizzes?{query}").status_code == 422, query
