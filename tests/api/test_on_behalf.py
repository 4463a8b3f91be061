"""Answers that another service hands in for its learners: the same answers, limits and secrets as for a student."""

import json
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import httpx
import pytest

from grader.gate.admission import ON_BEHALF
from support.sites import Site

API = "/api/v1"
ADA = {"namespace": "school", "id": "s1815"}


def hand_in(
    client: httpx.Client, question: str, answer: Any, learner: dict[str, Any] | None = None, *, key: str | None = None
) -> httpx.Response:
    body = {"learner": learner or ADA, "quiz": "small", "question": question, "answer": answer}
    return client.post(ON_BEHALF, json=body, headers={} if key is None else {"Idempotency-Key": key})


def members(site: Site) -> list[dict[str, Any]]:
    members = site.client("tina", "instructor").get(f"{API}/members").json()["items"]
    return [one for one in members if one["way_in"] == "lms"]


def feed(client: httpx.Client) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = client.get(f"{API}/results").json()["items"]
    return rows


@pytest.fixture
def lms(either_site: Site) -> httpx.Client:
    return either_site.client("lms", "service")


def test_a_learner_is_made_at_first_sight_and_found_again(either_site: Site, lms: httpx.Client) -> None:
    first = hand_in(lms, "q2", "6 ms")
    assert first.status_code == 201
    assert {"user": "school:s1815", "attempt": 1, "status": "graded"}.items() <= first.json().items()
    second = hand_in(lms, "q2", "5 ms").json()
    assert (second["learner"], second["attempt"], second["verdict"]["status"]) == (
        first.json()["learner"],
        2,
        "correct",
    )
    [member] = members(either_site)
    assert (member["id"], member["role"], member["learner"]) == (second["learner"], "student", ADA)
    assert hand_in(lms, "q2", "5 ms").status_code == 409  # this question has two attempts
    hand_in(lms, "q2", "5 ms", {"namespace": "school", "id": "s1816"})
    hand_in(lms, "q2", "5 ms", {"namespace": "other", "id": "s1815"})
    assert len(members(either_site)) == 3


def test_the_feed_and_the_gradebook_name_the_learner(either_site: Site, lms: httpx.Client) -> None:
    native = (
        either_site.client("bob")
        .post(f"{API}/submissions", json={"quiz": "small", "question": "q1", "answer": 1})
        .json()
    )
    hand_in(lms, "q1", 1, {**ADA, "name": "Ada"})
    rows = feed(lms)
    assert [(row["user"], row["learner"]) for row in rows] == [
        ("bob", {"namespace": "grader", "id": native["learner"]}),
        ("Ada", ADA),
    ]
    assert rows[0]["member"] == native["learner"]
    gradebook = lms.get(f"{API}/gradebook.csv")
    assert "Ada" in gradebook.text
    hand_in(lms, "q1", 0, {**ADA, "name": "Ada Lovelace"})  # changes no points
    again = lms.get(f"{API}/gradebook.csv", headers={"If-None-Match": gradebook.headers["etag"]})
    assert (again.status_code, "Ada Lovelace" in again.text) == (200, True)


def test_a_name_that_is_told_replaces_the_earlier_one(either_site: Site, lms: httpx.Client) -> None:
    names = [
        hand_in(lms, "q1", 0, {**ADA, **more}).json()["user"] for more in ({}, {"name": "Ada"}, {}, {"name": "A. L."})
    ]
    assert names == ["school:s1815", "Ada", "Ada", "A. L."]
    assert [member["name"] for member in members(either_site)] == ["A. L."]


def test_the_same_key_and_body_make_one_submission_and_another_body_422(lms: httpx.Client) -> None:
    first, again = (hand_in(lms, "q2", "6 ms", key="k") for _ in range(2))
    assert (again.status_code, again.json(), again.headers["location"]) == (
        201, first.json(), first.headers["location"],
    )  # fmt: skip
    assert hand_in(lms, "q2", "7 ms", key="k").status_code == 422
    other = hand_in(lms, "q2", "7 ms", {"namespace": "school", "id": "s2"}, key="k")
    assert other.status_code == 201  # a key is the learner's, not the service's


def test_a_learner_who_is_new_to_many_requests_at_once_is_one_member(either_site: Site, lms: httpx.Client) -> None:
    with ThreadPoolExecutor(6) as pool:
        made = list(pool.map(lambda n: hand_in(lms, "q1", n % 3).json()["learner"], range(12)))
    assert len(set(made)) == len(members(either_site)) == 1


def test_the_service_reads_what_the_learner_may_see(either_site: Site, lms: httpx.Client) -> None:
    wrong = hand_in(lms, "q1", 0)
    assert wrong.headers["location"] == f"{ON_BEHALF}/{wrong.json()['id']}"
    assert "SECRET" not in wrong.text
    shown = lms.get(wrong.headers["location"])
    assert shown.json() == wrong.json()
    assert shown.headers["etag"] == wrong.headers["etag"]
    tag = {"If-None-Match": shown.headers["etag"]}
    assert lms.get(wrong.headers["location"], headers=tag).status_code == 304
    hand_in(lms, "q1", 1)  # right: the explanation is theirs to see
    again = lms.get(wrong.headers["location"], headers=tag)
    assert (again.status_code, again.json()["verdict"]["explain"]) == (200, "SECRET explain")
    assert again.json()["seed"] is None


def test_a_service_sees_no_learner_of_ours_and_none_of_another_course(either_site: Site, lms: httpx.Client) -> None:
    theirs = hand_in(lms, "q1", 0).json()["id"]
    ours = (
        either_site.client("bob")
        .post(f"{API}/submissions", json={"quiz": "small", "question": "q1", "answer": 1})
        .json()["id"]
    )
    stranger = either_site.client("lms", "service", course="elsewhere")
    for client, submission in ((lms, ours), (stranger, theirs), (lms, "no-such")):
        assert client.get(f"{ON_BEHALF}/{submission}").status_code == 404
    assert lms.get(f"{API}/submissions/{theirs}").status_code == 403


@pytest.mark.parametrize("role", ["student", "instructor"])
def test_only_a_service_hands_in_for_others(site: Site, role: str) -> None:
    client = site.client(role, role)
    assert hand_in(client, "q1", 1).status_code == 403
    assert client.get(f"{ON_BEHALF}/{'0' * 32}").status_code == 403
    assert hand_in(site.anonymous(), "q1", 1).status_code == 401
    assert members(site) == []


@pytest.mark.parametrize(
    ("learner", "told"),
    [
        ({"namespace": "grader", "id": "x"}, "namespace"), ({"namespace": "", "id": "x"}, "namespace"),
        ({"namespace": "a b", "id": "x"}, "namespace"), ({"namespace": "n" * 65, "id": "x"}, "namespace"),
        ({"namespace": "a\nb", "id": "x"}, "namespace"), ({"namespace": "school", "id": ""}, "id"),
        ({"namespace": "school", "id": " x"}, "id"), ({"namespace": "school", "id": "a\u0000b"}, "id"),
        ({"namespace": "school", "id": "x" * 256}, "id"), ({"namespace": "school", "id": 7}, "id"),
        ({"namespace": "school"}, "id"), ({**ADA, "name": " "}, "name"), ({**ADA, "role": "instructor"}, "role"),
    ],
)  # fmt: skip
def test_a_learner_who_cannot_be_is_refused_and_told_why(site: Site, learner: dict[str, Any], told: str) -> None:
    refused = hand_in(site.client("lms", "service"), "q1", 1, learner)
    assert refused.status_code == 422
    assert refused.headers["content-type"] == "application/problem+json"
    assert told in refused.json()["detail"].lower()
    assert members(site) == []


def test_an_answer_that_cannot_be_read_makes_nobody_a_member(site: Site) -> None:
    lms = site.client("lms", "service")
    assert hand_in(lms, "none", 1).status_code == 404
    assert hand_in(lms, "q4", "x" * 70_000).status_code == 413
    body = json.dumps({"learner": ADA, "quiz": "small", "question": "q1", "answer": float("nan")})
    assert lms.post(ON_BEHALF, content=body, headers={"Content-Type": "application/json"}).status_code == 422
    assert members(site) == []


def test_who_was_removed_is_refused_and_who_was_erased_comes_as_somebody_new(site: Site) -> None:
    lms, tina = site.client("lms", "service"), site.client("tina", "instructor")
    first = hand_in(lms, "q1", 0, {**ADA, "name": "Ada"}).json()
    assert tina.delete(f"{API}/members/{first['learner']}").status_code == 204
    assert hand_in(lms, "q1", 1).status_code == 403
    from grader.courses.people.erasure import erase_learner

    database = site.app.state.services.database
    with database.write() as session:
        erase_learner(database, session, member_id=first["learner"], course=site.course)
    assert hand_in(lms, "q1", 1).json()["learner"] != first["learner"]
    rows = feed(lms)
    assert "Ada" not in str(rows) and ADA in [row["learner"] for row in rows]
    assert rows[0]["learner"] == {"namespace": "grader", "id": first["learner"]}


@pytest.mark.slow
def test_requests_count_for_each_learner_and_those_that_name_none_for_the_service(
    open_site_with: Callable[..., Site],
) -> None:
    site = open_site_with(rate_per_s=0.001, rate_burst=3)
    lms = site.client("lms", "service")
    for n in range(5):
        statuses = [hand_in(lms, "q1", 0, {"namespace": "school", "id": f"s{n}"}).status_code for _ in range(4)]
        assert statuses == [201, 201, 201, 429]
    assert [hand_in(lms, "q1", 0, {"namespace": "", "id": ""}).status_code for _ in range(4)] == [422, 422, 422, 429]
    limited = hand_in(site.client("eve"), "q1", 0)  # a student's own requests count as ever
    assert limited.status_code == 403


def test_a_revoked_token_hands_in_nothing(site: Site) -> None:
    lms, tina = site.client("lms", "service"), site.client("tina", "instructor")
    assert hand_in(lms, "q1", 0).status_code == 201
    [token] = [item["id"] for item in tina.get(f"{API}/tokens").json()["items"] if item["name"] == "lms"]
    tina.delete(f"{API}/tokens/{token}")
    assert hand_in(lms, "q1", 0).status_code == 401
    assert hand_in(lms, "none", 0).status_code == 401
