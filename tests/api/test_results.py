"""Attempts, dates, extensions, the feed, the gradebook and the statistics, over HTTP."""

import csv
import io
import json
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import httpx
import pytest

from support.sites import QUIZ, Site

API = "/api/v1"
DAY = timedelta(days=1)
NOW = datetime.now(UTC)


def hand_in(client: httpx.Client, question: str, answer: Any, quiz: str = "small") -> httpx.Response:
    return client.post(f"{API}/submissions", json={"quiz": quiz, "question": question, "answer": answer})


def question_of(client: httpx.Client, question: str, quiz: str = "small") -> dict[str, Any]:
    shown: list[dict[str, Any]] = client.get(f"{API}/quizzes/{quiz}").json()["questions"]
    return next(one for one in shown if one["id"] == question)


def feed(client: httpx.Client, cursor: str | None = None) -> tuple[list[dict[str, Any]], str]:
    """Every row from a cursor on, three at a time, and the last cursor."""
    rows = []
    while True:
        page = client.get(f"{API}/results", params={"limit": 3} | ({"cursor": cursor} if cursor else {})).json()
        rows += page["items"]
        cursor = page["next_cursor"]
        if not page["items"]:
            assert cursor is not None
            return rows, cursor


def test_the_feed_tells_what_counts_and_its_last_cursor_goes_on(either_site: Site) -> None:
    ann, bob, lms = either_site.client("ann"), either_site.client("bob"), either_site.client("lms", "service")
    assert feed(lms)[0] == []
    wrong = hand_in(ann, "q1", 0).json()
    for question, answer in (("q2", "5 ms"), ("q3", 1), ("q4", "Because.")):
        hand_in(bob, question, answer)
    rows, cursor = feed(lms)
    told = {"submission_id": wrong["id"], "user": "ann", "quiz": "small", "question": "q1", "points": 0.0,
            "max_points": 1.0, "revision": 1, "attempt": 1, "is_late": False, "is_final": True}  # fmt: skip
    assert told.items() <= rows[0].items()
    assert [(row["user"], row["question"], row["is_final"]) for row in rows[1:]] == [
        ("bob", "q2", True),
        ("bob", "q3", True),
        ("bob", "q4", False),
    ]
    right = hand_in(ann, "q1", 1).json()
    hand_in(ann, "q1", 2)  # no better: nothing that counts has changed
    later, _ = feed(lms, cursor)
    assert [(row["submission_id"], row["points"], row["revision"]) for row in later] == [(right["id"], 1.0, 2)]


def test_a_review_revises_the_result(either_site: Site) -> None:
    ann, tina, lms = (
        either_site.client("ann"),
        either_site.client("tina", "instructor"),
        either_site.client("l", "service"),
    )
    made = hand_in(ann, "q4", "Because.").json()
    tina.put(f"{API}/submissions/{made['id']}/review", json={"points": 0.5}, headers={"If-Match": "*"})
    rows, _ = feed(lms)
    assert [(row["points"], row["is_final"], row["revision"]) for row in rows] == [(0.0, False, 1), (0.5, True, 2)]


def test_an_unchanged_feed_is_not_sent_again(site: Site, ann: httpx.Client) -> None:
    lms = site.client("lms", "service")
    hand_in(ann, "q1", 0)
    tag = lms.get(f"{API}/results").headers["etag"]
    assert lms.get(f"{API}/results", headers={"If-None-Match": tag}).status_code == 304
    hand_in(ann, "q1", 1)
    assert lms.get(f"{API}/results", headers={"If-None-Match": tag}).status_code == 200


@pytest.mark.parametrize("cursor", ["x", "YXQ6YWI", "%00"])
def test_a_cursor_that_was_never_given_is_refused(site: Site, cursor: str) -> None:
    assert site.client("lms", "service").get(f"{API}/results", params={"cursor": cursor}).status_code == 422


ROUTES = {
    "/results": {"student": 403, "instructor": 403, "service": 200},
    "/gradebook.csv": {"student": 403, "instructor": 200, "service": 200},
    "/quizzes/small/statistics": {"student": 403, "instructor": 200, "service": 403},
    "/quizzes/small/extensions": {"student": 403, "instructor": 200, "service": 403},
}


@pytest.mark.parametrize("path", ROUTES)
def test_who_may_fetch_what(site: Site, path: str) -> None:
    assert site.anonymous().get(API + path).status_code == 401
    statuses = {role: site.client(role, role).get(API + path).status_code for role in ROUTES[path]}
    assert statuses == ROUTES[path]


def test_the_gradebook_has_a_row_for_each_learner_and_none_for_instructors(either_site: Site) -> None:
    """Also for one who has not begun, but not for a browser that merely opened the page."""
    ann, bob, tina = either_site.client("ann"), either_site.client("bob"), either_site.client("tina", "instructor")
    either_site.client("abel")
    either_site.anonymous().post("/session", headers={"Sec-Fetch-Site": "same-origin"})
    for client in (bob, ann, tina):
        hand_in(client, "q1", 1)
    hand_in(ann, "q2", "6 ms")
    response = tina.get(f"{API}/gradebook.csv", params={"quiz": "small"})
    assert response.headers["content-type"] == "text/csv; charset=utf-8"
    rows = list(csv.DictReader(io.StringIO(response.text)))
    assert [(row["user"], row["small/q1"], row["small/q2"], row["points"], row["max_points"]) for row in rows] == [
        ("ann", "1", "0", "1", "4"),
        ("bob", "1", "", "1", "4"),
        ("abel", "", "", "0", "4"),
    ]
    for form, who, before in (("canvas", "SIS Login ID", [""]), ("moodle", "Username", [])):  # Canvas: the points first
        text = tina.get(f"{API}/gradebook.csv", params={"quiz": "small", "format": form}).text
        assert [row[who] for row in csv.DictReader(io.StringIO(text))] == [*before, "ann", "bob", "abel"]
    tag = {"If-None-Match": response.headers["etag"]}
    assert tina.get(f"{API}/gradebook.csv?quiz=small", headers=tag).status_code == 304
    either_site.client("zoe")
    assert "zoe" in tina.get(f"{API}/gradebook.csv?quiz=small", headers=tag).text
    assert tina.get(f"{API}/gradebook.csv?quiz=none").status_code == 404
    assert tina.get(f"{API}/gradebook.csv?format=excel").status_code == 422
    [abel] = [row["id"] for row in rows if row["user"] == "abel"]
    assert tina.patch(f"{API}/members/{abel}", json={"name": "anna"}).status_code == 200
    text = tina.get(f"{API}/gradebook.csv", params={"quiz": "small", "format": "moodle"}).text
    assert sorted(row["Username"] for row in csv.DictReader(io.StringIO(text))) == ["abel", "ann", "bob", "zoe"]


def test_the_gradebook_of_all_quizzes_has_a_sum_for_each(either_site: Site) -> None:
    """The totals are those of the gradebook by question; what waits for its first mark is no zero."""
    ann, bob, tina = either_site.client("ann"), either_site.client("bob"), either_site.client("tina", "instructor")
    hand_in(ann, "q1", 1)
    hand_in(ann, "q2", "5 ms")
    hand_in(bob, "q4", "Because.")

    def rows(**params: str) -> list[dict[str, str]]:
        return list(csv.DictReader(io.StringIO(tina.get(f"{API}/gradebook.csv", params=params).text)))

    sums = rows(by="quiz")
    assert [(row["user"], row["small"], row["points"]) for row in sums] == [("ann", "2", "2"), ("bob", "", "0")]
    total = ("user", "points", "max_points")
    assert [[row[name] for name in total] for row in sums] == [[row[name] for name in total] for row in rows()]
    assert "A small quiz" in rows(by="quiz", format="canvas")[0]
    assert tina.get(f"{API}/gradebook.csv?by=lesson").status_code == 422


def test_statistics_count_options_wrong_numbers_and_mistakes(either_site: Site) -> None:
    tina = either_site.client("tina", "instructor")
    for n, (option, number) in enumerate([(0, "5000 ms"), (0, "5000 ms"), (1, "5 ms"), (2, "6 ms")]):
        learner = either_site.client(f"u{n}")
        hand_in(learner, "q1", option)
        hand_in(learner, "q1", 1)
        hand_in(learner, "q2", number)
    statistics = tina.get(f"{API}/quizzes/small/statistics").json()
    first, second = statistics["questions"]
    assert (statistics["learners"], first["question"], second["question"]) == (4, "q1", "q2")
    assert (first["difficulty"]["value"], first["right_at_once"]["value"]) == (1.0, 0.25)
    assert first["options"] == [{"option": n, "learners": k} for n, k in ((0, 2), (1, 1), (2, 1))]
    assert [(cluster["value"], cluster["learners"]) for cluster in second["clusters"]] == [(5000.0, 2)]
    assert second["mistakes"][0]["learners"] == 2
    assert second["difficulty"]["n"] == 4


def with_policy(content: Path, **policy: Any) -> None:
    quiz = {**QUIZ, "policy": {name: at.isoformat() if isinstance(at, datetime) else at for name, at in policy.items()}}
    (content / "quizzes" / "small.json").write_text(json.dumps(quiz))


@pytest.fixture
def exam(open_site_with: Callable[..., Site], content: Path) -> Callable[..., Site]:
    """A server whose quiz has a policy."""

    def open_it(**policy: Any) -> Site:
        with_policy(content, **policy)
        return open_site_with()

    return open_it


def test_before_it_opens_a_quiz_shows_no_questions(exam: Callable[..., Site]) -> None:
    site = exam(opens=NOW + DAY)
    ann, tina = site.client("ann"), site.client("tina", "instructor")
    assert ann.get(f"{API}/quizzes/small").json()["questions"] == []
    assert ann.get(f"{API}/quizzes").json()["items"][0]["opens"] is not None
    for response in (
        hand_in(ann, "q1", 1),
        ann.post(f"{API}/answers:validate", json={"quiz": "small", "question": "q1", "answer": 1}),
        ann.post(f"{API}/labs:run", json={"quiz": "small", "lab": "five"}),
    ):
        assert response.status_code == 409
        assert response.json()["detail"].startswith("This quiz opens on ")
    page = site.anonymous().get("/").text
    assert "This quiz opens on " in page
    assert "How long?" not in page
    assert len(tina.get(f"{API}/quizzes/small").json()["questions"]) == 4
    assert hand_in(tina, "q1", 1).status_code == 201


@pytest.mark.slow
def test_after_it_closed_an_extension_lets_one_learner_answer(exam: Callable[..., Site]) -> None:
    site = exam(due=NOW - DAY, late={"per_day": 0.5, "until": (NOW - DAY / 2).isoformat()})
    ann, bob, tina = site.client("ann"), site.client("bob"), site.client("tina", "instructor")
    refused = hand_in(ann, "q1", 1)
    assert (refused.status_code, refused.json()["detail"][:20]) == (409, "This quiz closed on ")
    more = {"user": "ann", "until": (NOW + DAY).isoformat()}
    assert tina.put(f"{API}/quizzes/small/extensions", json=more).status_code == 200
    assert hand_in(ann, "q1", 1).status_code == 201
    assert hand_in(bob, "q1", 1).status_code == 409
    late = question_of(ann, "q1")["result"]
    assert (late["points"], late["is_late"]) == (0.25, True)
    longer = more | {"due": (NOW + DAY).isoformat()}
    assert tina.put(f"{API}/quizzes/small/extensions", json=longer).status_code == 200
    assert question_of(ann, "q1")["result"]["points"] == 1  # the later due date counts for what was handed in already
    assert [row["points"] for row in feed(site.client("lms", "service"))[0]] == [0.25, 1.0]
    assert [row["user"] for row in tina.get(f"{API}/quizzes/small/extensions").json()["items"]] == ["ann"]
    assert tina.put(f"{API}/quizzes/small/extensions", json={"user": "ann"}).status_code == 200
    assert tina.get(f"{API}/quizzes/small/extensions").json()["items"] == []
    assert hand_in(ann, "q1", 1).status_code == 409


@pytest.mark.slow
def test_an_extension_adds_attempts(exam: Callable[..., Site]) -> None:
    site = exam(attempts=1)
    ann, tina = site.client("ann"), site.client("tina", "instructor")
    assert [hand_in(ann, "q1", answer).status_code for answer in (0, 1)] == [201, 409]
    assert question_of(ann, "q1")["notice"] == "The only attempt at this question is used up."
    tina.put(f"{API}/quizzes/small/extensions", json={"user": "ann", "attempts": 1})
    assert question_of(ann, "q1")["notice"] == "1 of 2 attempts left; the best one counts."
    assert [hand_in(ann, "q1", answer).status_code for answer in (1, 1)] == [201, 409]


def test_an_extension_finds_who_bears_the_name_and_makes_nobody(exam: Callable[..., Site]) -> None:
    site = exam(attempts=1)
    lms, tina = site.client("lms", "service"), site.client("tina", "instructor")
    for number, name in enumerate(("Ada L", "Bo B", "Bo B")):
        learner = {"namespace": "school", "id": str(number), "name": name}
        answer = {"learner": learner, "quiz": "small", "question": "q1", "answer": 0}
        assert lms.post(f"{API}/lms/submissions", json=answer).status_code == 201
    members = tina.get(f"{API}/members").json()["items"]
    path = f"{API}/quizzes/small/extensions"
    given = tina.put(path, json={"user": "Ada L", "attempts": 1}).json()
    assert given["learner"] == next(member["id"] for member in members if member["name"] == "Ada L")
    unknown = tina.put(path, json={"user": "Adda", "attempts": 1})
    assert (unknown.status_code, "'Adda'" in unknown.json()["detail"]) == (404, True)
    several = tina.put(path, json={"user": "Bo B", "attempts": 1})
    assert several.status_code == 422
    last = several.json()["detail"].rstrip(".").split()[-1]
    assert tina.put(path, json={"user": last, "attempts": 1}).json()["learner"] == last
    assert tina.get(f"{API}/members").json()["items"] == members


@pytest.mark.parametrize(
    "body", [{}, {"user": ""}, {"user": "a", "attempts": -1}, {"user": "a", "due": "2026-03-01T12:00"}, {"user": "a\0"}]
)
def test_extensions_that_make_no_sense_are_refused(teacher: httpx.Client, body: dict[str, Any]) -> None:
    assert teacher.put(f"{API}/quizzes/small/extensions", json=body).status_code == 422
    assert teacher.put(f"{API}/quizzes/none/extensions", json={"user": "a"}).status_code == 404


def test_late_answers_of_an_extension_do_not_end_before_it_is_due(teacher: httpx.Client, ann: httpx.Client) -> None:
    assert ann.get(f"{API}/quizzes").status_code == 200
    dates = {"user": "ann", "due": (NOW + DAY).isoformat()}
    refused = teacher.put(f"{API}/quizzes/small/extensions", json=dates | {"until": NOW.isoformat()})
    told = "late: needs a due date, and an until that is later"  # as of the policy of a quiz
    assert (refused.status_code, refused.json()["detail"]) == (422, told)
    given = teacher.put(f"{API}/quizzes/small/extensions", json=dates | {"until": dates["due"]})
    assert given.status_code == 200


def test_the_solution_is_shown_once_right_or_spent(ann: httpx.Client) -> None:
    wrong = hand_in(ann, "q1", 0)
    assert wrong.json()["verdict"]["explain"] is None
    assert hand_in(ann, "q1", 1).json()["verdict"]["explain"] == "SECRET explain"
    again = ann.get(wrong.headers["location"], headers={"If-None-Match": wrong.headers["etag"]})
    assert again.status_code == 200
    assert again.json()["verdict"]["explain"] == "SECRET explain"


def test_a_changed_policy_is_counted_on_request(exam: Callable[..., Site], content: Path) -> None:
    site = exam(counts="best")
    ann, tina = site.client("ann"), site.client("tina", "instructor")
    for answer in (1, 0):
        hand_in(ann, "q1", answer)
    with_policy(content, counts="average")
    tina.post(f"{API}/content:reload")
    assert tina.post(f"{API}/quizzes/small/results:recount").json() == {"recounted": 1}
    assert question_of(ann, "q1")["result"]["points"] == 0.5


def test_a_question_that_the_content_has_lost_shows_its_verdicts_to_instructors_only(
    exam: Callable[..., Site], content: Path
) -> None:
    site = exam()
    ann, tina = site.client("ann"), site.client("tina", "instructor")
    made = hand_in(ann, "q1", 1).json()
    (content / "quizzes" / "small.json").write_text(
        json.dumps({**QUIZ, "questions": [{**QUIZ["questions"][1], "id": "other"}]})
    )
    assert tina.post(f"{API}/content:reload").status_code == 200
    assert ann.get(f"{API}/submissions/{made['id']}").json()["verdict"]["status"] == "needs_review"
    assert tina.get(f"{API}/submissions/{made['id']}").json()["verdict"]["status"] == "correct"
