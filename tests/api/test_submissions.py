"""Handing in, reading back, listing; once, in order, and only what is one's own."""

import json
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import httpx
import pytest

SUBMISSIONS = "/api/v1/submissions"


def hand_in(client: httpx.Client, question: str, answer: Any, **headers: str) -> httpx.Response:
    body = {"quiz": "small", "question": question, "answer": answer}
    return client.post(SUBMISSIONS, json=body, headers=headers)


def test_a_choice_is_answered_at_once(ann: httpx.Client) -> None:
    response = hand_in(ann, "q1", 1)
    body = response.json()
    assert response.status_code == 201
    assert response.headers["location"] == f"{SUBMISSIONS}/{body['id']}"
    assert {"quiz": "small", "question": "q1", "user": "ann", "status": "graded", "attempt": 1}.items() <= body.items()
    assert body["verdict"]["status"] == "correct"
    assert body["created_at"].endswith(("Z", "+00:00"))
    again = ann.get(response.headers["location"])
    assert again.json() == body
    assert again.headers["etag"] == response.headers["etag"]


def test_a_number_is_answered_with_what_was_understood(ann: httpx.Client) -> None:
    response = hand_in(ann, "q2", "0.005 s")
    assert response.status_code == 201
    assert response.json()["verdict"]["read_as"] == "5 ms"
    assert response.json()["verdict"]["status"] == "correct"


def test_a_text_waits_for_an_instructor(ann: httpx.Client) -> None:
    response = hand_in(ann, "q4", "Because.")
    assert response.status_code == 201
    assert response.json()["status"] == "needs_review"
    assert response.json()["verdict"]["status"] == "needs_review"


@pytest.mark.parametrize("answer", [True, False, 7, -1, "b?", None, [1], {"source": "x"}, 1.5, 1e300])
def test_an_invalid_option_is_an_invalid_answer_and_uses_no_attempt(ann: httpx.Client, answer: Any) -> None:
    response = ann.post(
        SUBMISSIONS,
        content=f'{{"quiz": "small", "question": "q1", "answer": {json.dumps(answer)}}}',
        headers={"Content-Type": "application/json"},
    )
    assert response.status_code == 201, response.text
    assert response.json()["verdict"]["status"] == "invalid_answer"
    assert ann.get(response.headers["location"]).status_code == 200
    assert hand_in(ann, "q1", 1).json()["attempt"] == 1


@pytest.mark.parametrize("path", [SUBMISSIONS, "/api/v1/answers:validate"])
@pytest.mark.parametrize("answer", ["NaN", "[1, Infinity]", '{"a": {"b": -Infinity}}', "1e999"])
@pytest.mark.parametrize("behind", ["", 1001 * " "], ids=["short", "long"])
def test_a_number_that_json_has_not_is_refused(ann: httpx.Client, path: str, answer: str, behind: str) -> None:
    refused = ann.post(
        path,
        content=f'{{"quiz": "small", "question": "q2", "answer": {answer}}}{behind}',
        headers={"Content-Type": "application/json"},
    )
    assert refused.status_code == 422
    assert "The answer is not JSON, which has no NaN" in refused.json()["detail"]
    assert ann.get(SUBMISSIONS).json()["items"] == []


def test_attempts_run_out_and_only_real_ones_count(ann: httpx.Client) -> None:
    assert hand_in(ann, "q2", "5 kg").json()["attempt"] == 1
    assert hand_in(ann, "q2", "6 ms").json()["attempt"] == 1
    assert hand_in(ann, "q2", "7 ms").json()["attempt"] == 2
    refused = hand_in(ann, "q2", "5 ms")
    assert refused.status_code == 409
    assert refused.headers["content-type"] == "application/problem+json"
    assert len(ann.get(SUBMISSIONS).json()["items"]) == 3


def test_attempts_at_the_same_moment_cannot_slip_past_the_limit(either_site: Any) -> None:
    client = either_site.client("ann")
    with ThreadPoolExecutor(6) as pool:
        statuses = sorted(pool.map(lambda _: hand_in(client, "q2", "6 ms").status_code, range(6)))
    assert statuses == [201, 201, 409, 409, 409, 409]


def test_the_same_key_and_body_make_one_submission(ann: httpx.Client, bob: httpx.Client) -> None:
    first = hand_in(ann, "q2", "6 ms", **{"Idempotency-Key": "k"})
    again = hand_in(ann, "q2", "6 ms", **{"Idempotency-Key": "k"})
    assert (again.status_code, again.json()) == (201, first.json())
    assert again.headers["location"] == first.headers["location"]
    assert len(ann.get(SUBMISSIONS).json()["items"]) == 1
    other = hand_in(ann, "q2", "7 ms", **{"Idempotency-Key": "k"})
    assert other.status_code == 422
    assert hand_in(bob, "q2", "7 ms", **{"Idempotency-Key": "k"}).status_code == 201


def test_a_replay_comes_before_the_limit_of_attempts(ann: httpx.Client) -> None:
    first = hand_in(ann, "q2", "6 ms", **{"Idempotency-Key": "k"})
    hand_in(ann, "q2", "6 ms")
    again = hand_in(ann, "q2", "6 ms", **{"Idempotency-Key": "k"})
    assert (again.status_code, again.json()["id"]) == (201, first.json()["id"])
    expected = [one.json()["verdict"]["findings"][0]["expected"] for one in (first, again)]
    assert expected == [None, 5.0], "with the attempts spent the expected value is shown"


def test_the_same_key_at_the_same_moment(either_site: Any) -> None:
    client = either_site.client("ann")
    with ThreadPoolExecutor(6) as pool:
        answers = list(pool.map(lambda _: hand_in(client, "q1", 1, **{"Idempotency-Key": "k"}), range(6)))
    assert {answer.status_code for answer in answers} == {201}
    assert len({answer.json()["id"] for answer in answers}) == 1


def test_a_foreign_submission_looks_like_a_missing_one(
    ann: httpx.Client, bob: httpx.Client, teacher: httpx.Client
) -> None:
    theirs = hand_in(ann, "q1", 1).headers["location"]
    bob.headers["X-Request-ID"] = "the-same-for-all"
    refused, missing = bob.get(theirs), bob.get(theirs[:-1] + ("0" if theirs[-1] != "0" else "1"))
    assert refused.status_code == missing.status_code == 404
    assert refused.json() == missing.json()
    assert bob.get(f"{theirs}/events").json() == refused.json()
    assert teacher.get(theirs).json()["user"] == "ann"


def test_courses_do_not_see_each_other(site: Any, teacher: httpx.Client) -> None:
    elsewhere = site.client("ann", "student", "other")
    theirs = hand_in(elsewhere, "q1", 1).headers["location"]
    assert teacher.get(theirs).status_code == 404
    assert teacher.get(SUBMISSIONS).json()["items"] == []
    assert site.client("olga", "instructor", "other").get(theirs).status_code == 200


def test_lists_hold_the_learners_own_submissions_and_all_for_the_instructor(
    ann: httpx.Client, bob: httpx.Client, teacher: httpx.Client
) -> None:
    hand_in(ann, "q1", 1)
    hand_in(bob, "q1", 2)
    hand_in(bob, "q3", 1)

    def users(client: httpx.Client, query: str = "") -> list[str]:
        return [item["user"] for item in client.get(f"{SUBMISSIONS}{query}").json()["items"]]

    assert users(ann) == ["ann"]
    assert users(ann, "?user=ann") == ["ann"]
    assert users(ann, "?user=bob") == []
    assert users(teacher) == ["bob", "bob", "ann"]
    assert users(teacher, "?user=ann") == ["ann"]
    assert users(teacher, "?quiz=small&question=q1") == ["bob", "ann"]
    assert users(teacher, "?quiz=none") == []


def test_pages_follow_each_other_by_link_and_by_cursor(ann: httpx.Client) -> None:
    made = [hand_in(ann, "q1", n % 3).json()["id"] for n in range(5)]
    seen, url, cursors = [], f"{SUBMISSIONS}?limit=2&quiz=small", []
    while url:
        response = ann.get(url)
        seen += [item["id"] for item in response.json()["items"]]
        cursors.append(response.json()["next_cursor"])
        url = response.links["next"]["url"] if "next" in response.links else ""
    assert seen == made[::-1]
    assert cursors[-1] is None
    assert [item["id"] for item in ann.get(f"{SUBMISSIONS}?limit=2&cursor={cursors[0]}").json()["items"]] == seen[2:4]


@pytest.mark.parametrize(
    "query", ["cursor=zzz", "cursor=%00", "cursor=YmVmb3JlOg", "limit=0", "limit=101", "limit=x", "user=%00"]
)
def test_invalid_query_parameters_are_422(ann: httpx.Client, query: str) -> None:
    response = ann.get(f"{SUBMISSIONS}?{query}")
    assert response.status_code == 422
    assert response.headers["content-type"] == "application/problem+json"


def test_an_etag_that_still_holds_saves_the_answer(ann: httpx.Client) -> None:
    made = hand_in(ann, "q1", 1)
    response = ann.get(made.headers["location"], headers={"If-None-Match": made.headers["etag"]})
    assert (response.status_code, response.content) == (304, b"")
    assert ann.get(made.headers["location"], headers={"If-None-Match": '"old"'}).status_code == 200


def test_validating_says_what_is_understood_and_keeps_nothing(ann: httpx.Client) -> None:
    def validate(question: str, answer: Any) -> Any:
        return ann.post("/api/v1/answers:validate", json={"quiz": "small", "question": question, "answer": answer})

    assert validate("q2", "0.005 s").json() == {"valid": True, "read_as": "5 ms", "message": None}
    wrong = validate("q2", "5 kg").json()
    assert not wrong["valid"]
    assert wrong["message"]
    assert validate("q9", "5").status_code == 404
    assert ann.get(SUBMISSIONS).json()["items"] == []


@pytest.mark.parametrize(
    "body", [{"quiz": "none", "question": "q1", "answer": 1}, {"quiz": "small", "question": "q9", "answer": 1}]
)
def test_a_question_that_is_not_there_is_not_found(ann: httpx.Client, body: dict[str, Any]) -> None:
    assert ann.post(SUBMISSIONS, json=body).status_code == 404


@pytest.mark.parametrize(
    "body",
    [
        b"",
        b"{",
        b"[]",
        b'{"quiz": "small", "question": "q1"}',
        b'{"quiz": "small", "question": "q1", "answer": 1, "more": 2}',
        b'{"quiz": 5, "question": "q1", "answer": 1}',
        b'{"quiz": "small", "question": "q4", "answer": "\xff\xfe"}',
        b'{"quiz": "small", "question": "q4", "answer": "\\ud800"}',
        b'{"quiz": "small", "question": "q1", "answer": ' + b"[" * 100_000 + b"]" * 100_000 + b"}",
        b'{"quiz": "small", "question": "q1", "answer": ' + b"9" * 5_000 + b"}",
    ],
    ids=["empty", "broken", "list", "missing", "unknown", "type", "not-utf8", "surrogate", "deep", "long-number"],
)
def test_invalid_bodies_are_422(ann: httpx.Client, body: bytes) -> None:
    response = ann.post(SUBMISSIONS, content=body, headers={"Content-Type": "application/json"})
    assert response.status_code == 422, response.text
    assert response.headers["content-type"] == "application/problem+json"
    assert "small" not in response.json()["detail"]


@pytest.mark.parametrize(("levels", "status"), [(2, 201), (16, 201), (17, 422), (300, 422), (900, 422)])
def test_nested_answers_are_invalid_and_from_some_depth_on_refused(ann: httpx.Client, levels: int, status: int) -> None:
    text = "[" * levels + "]" * levels
    response = ann.post(
        SUBMISSIONS,
        content=f'{{"quiz": "small", "question": "q1", "answer": {text}}}',
        headers={"Content-Type": "application/json"},
    )
    assert response.status_code == status
    if status == 201:
        assert response.json()["verdict"]["status"] == "invalid_answer"
        assert ann.get(response.headers["location"]).status_code == 200


def test_texts_have_a_size_and_bodies_have_one(ann: httpx.Client) -> None:
    assert hand_in(ann, "q4", "x" * 70_000).status_code == 413
    too_large = ann.post(SUBMISSIONS, content=b"x" * (2049 * 1024), headers={"Content-Type": "application/json"})
    assert too_large.status_code == 413
    assert too_large.headers["content-type"] == "application/problem+json"

    def chunks() -> Any:
        yield from [b" " * 65536] * 40

    unannounced = ann.post(SUBMISSIONS, content=chunks(), headers={"Content-Type": "application/json"})
    assert unannounced.status_code == 413


def test_any_text_can_be_kept_and_read_back(either_site: Any) -> None:
    client = either_site.client("Ännchen 🤖")
    text = "nul \x00, line\u2028, emoji 🤖, escape \x1b[31m, 'quotes'; DROP TABLE submissions"
    made = hand_in(client, "q4", text)
    assert made.status_code == 201, made.text
    shown = client.get(made.headers["location"]).json()
    assert (shown["answer"], shown["user"]) == (text, "Ännchen 🤖")
