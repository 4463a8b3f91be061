"""Short answers are taken past FastAPI, and get what its route says of the same answer in a longer body."""

import json
from typing import Any

import httpx
import pytest

SUBMISSIONS = "/api/v1/submissions"
OF_ITSELF = ("id", "attempt", "created_at", "request_id")

BODIES: dict[str, Any] = {
    "a right choice": {"quiz": "1.3-check", "question": "q1", "answer": 1},
    "a wrong number": {"quiz": "1.3-check", "question": "q2", "answer": "2.5 ms"},
    "an answer that cannot be read": {"quiz": "1.3-check", "question": "q2", "answer": [5]},
    "a text": {"quiz": "1.3-check", "question": "q4", "answer": "Because of the damping."},
    "an unknown question": {"quiz": "1.3-check", "question": "q99", "answer": 1},
    "an unknown key": {"quiz": "1.3-check", "question": "q1", "answer": 1, "seed": 4},
    "no answer": {"quiz": "1.3-check", "question": "q1"},
    "no object": [1],
}


def describe(response: httpx.Response) -> tuple[Any, ...]:
    """What a response says, without what differs between any two requests."""
    body = {name: value for name, value in response.json().items() if name not in OF_ITSELF}
    body["verdict"] = {name: value for name, value in (body.get("verdict") or {}).items() if name != "timing_ms"}
    names = sorted(response.headers.keys())
    return response.status_code, response.headers["content-type"], names, body


@pytest.mark.parametrize("name", BODIES)
def test_both_ways_say_the_same(ann: httpx.Client, name: str) -> None:
    headers, text = {"Content-Type": "application/json"}, json.dumps(BODIES[name])
    short = ann.post(SUBMISSIONS, content=text, headers=headers)
    long = ann.post(SUBMISSIONS, content=text + 1000 * " ", headers=headers)
    assert describe(short) == describe(long)


@pytest.mark.parametrize("text", ["", "{", '{"quiz": NaN}', '"\\ud800"', "\ufeff{}"])
def test_both_ways_refuse_what_is_no_json(ann: httpx.Client, text: str) -> None:
    headers = {"Content-Type": "application/json"}
    short = ann.post(SUBMISSIONS, content=text.encode(), headers=headers)
    long = ann.post(SUBMISSIONS, content=text.encode() + 1001 * b" ", headers=headers)
    assert short.status_code == long.status_code == 422
    assert short.headers["content-type"] == "application/problem+json"


def test_an_answer_without_a_valid_token_is_refused_before_its_body(ann: httpx.Client) -> None:
    refused = ann.post(SUBMISSIONS, json=[1], headers={"Authorization": "Bearer grt_0_0"})
    assert refused.status_code == 401
