"""Reviews: the list, exclusive claims, and If-Match against lost updates."""

from concurrent.futures import ThreadPoolExecutor
from datetime import timedelta
from typing import Any

import httpx
import pytest

from grader.courses.reviewing import reviews
from grader.gate.admission import PREFIX as API
from grader.store.regrades import find_reviewed
from support.sites import Site


def hand_in(client: httpx.Client, answer: str = "because", question: str = "q4") -> dict[str, Any]:
    response = client.post(f"{API}/submissions", json={"quiz": "small", "question": question, "answer": answer})
    assert response.status_code == 201
    made: dict[str, Any] = response.json()
    return made


def claim(client: httpx.Client, **body: Any) -> httpx.Response:
    return client.post(f"{API}/reviews:claim", json=body)


def decide(client: httpx.Client, submission_id: str, etag: str | None, **body: Any) -> httpx.Response:
    headers = {} if etag is None else {"If-Match": etag}
    return client.put(f"{API}/submissions/{submission_id}/review", json=body, headers=headers)


def waiting(client: httpx.Client, **query: Any) -> list[str]:
    return [item["id"] for item in client.get(f"{API}/reviews", params=query).json()["items"]]


def test_an_open_answer_is_claimed_and_reviewed_and_its_learner_sees_it(either_site: Site) -> None:
    ann, tina = either_site.client("ann"), either_site.client("tina", "instructor")
    made = hand_in(ann)
    assert waiting(tina) == [made["id"]]
    held = claim(tina, quiz="small")
    assert held.status_code == 200
    assert (held.json()["id"], held.json()["answer"]) == (made["id"], "because")
    assert held.json()["reference"] == "SECRET reference"
    assert held.json()["claim"]["by"] == "tina"
    done = decide(tina, made["id"], held.headers["ETag"], points=0.5, comment=" Half of it.\n")
    assert done.status_code == 200
    seen = ann.get(f"{API}/submissions/{made['id']}")
    assert seen.headers["ETag"] == done.headers["ETag"] != held.headers["ETag"]
    verdict = seen.json()["verdict"]
    assert (seen.json()["status"], seen.json()["revision"]) == ("graded", 2)
    assert (verdict["status"], verdict["points"], verdict["max_points"]) == ("partial", 0.5, 1.0)
    assert verdict["findings"][0]["message"] == "Half of it."
    assert "SECRET" not in seen.text
    assert waiting(tina) == []
    stream = ann.get(f"{API}/submissions/{made['id']}/events").text
    assert stream.rstrip().rsplit("event: ", 1)[1].startswith("graded")


@pytest.mark.parametrize(("points", "status"), [(0, "incorrect"), (0.25, "partial"), (1, "correct")])
def test_the_status_follows_from_the_points(site: Site, points: float, status: str) -> None:
    made, tina = hand_in(site.client("ann")), site.client("tina", "instructor")
    done = decide(tina, made["id"], "*", points=points).json()
    assert (done["verdict"]["status"], done["verdict"]["points"]) == (status, points)
    assert done["verdict"]["findings"][0]["message"]


def test_any_verdict_may_be_reviewed_more_than_once(site: Site) -> None:
    made, tina = hand_in(site.client("ann"), "7 ms", "q2"), site.client("tina", "instructor")
    assert made["verdict"]["status"] == "incorrect"
    first = decide(tina, made["id"], "*", points=1, comment="a slip of ours")
    second = decide(tina, made["id"], first.headers["ETag"], points=0, comment="no, it was not")
    findings = second.json()["verdict"]["findings"]
    assert (second.json()["revision"], [f["id"] for f in findings].count("review")) == (3, 1)
    assert len(findings) == 1 + len(made["verdict"]["findings"])


def test_a_claim_keeps_others_out_until_it_expires(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    made = hand_in(site.client("ann"))
    tina, tom = site.client("tina", "instructor"), site.client("tom", "instructor")
    etag = claim(tina, submission_id=made["id"]).headers["ETag"]
    refused = claim(tom, submission_id=made["id"])
    assert refused.status_code == 409
    assert "tina is reviewing" in refused.json()["detail"]
    assert claim(tom).status_code == 404
    assert decide(tom, made["id"], etag, points=1).status_code == 409
    assert claim(tina).json()["id"] == made["id"]
    monkeypatch.setattr(reviews, "CLAIM", timedelta(seconds=-1))
    claim(tina, submission_id=made["id"])
    monkeypatch.undo()
    assert claim(tom).json()["claim"]["by"] == "tom"
    assert decide(tina, made["id"], etag, points=1).status_code == 409
    assert decide(tom, made["id"], etag, points=1).status_code == 200


@pytest.mark.slow
def test_instructors_who_claim_at_once_get_one_each(either_site: Site) -> None:
    made = {hand_in(either_site.client(f"learner{number}"))["id"] for number in range(6)}
    people = [either_site.client(f"teacher{number}", "instructor") for number in range(6)]
    with ThreadPoolExecutor(6) as pool:
        held = [answer.json()["id"] for answer in pool.map(claim, people)]
    assert sorted(held) == sorted(made)


def test_a_review_of_an_outdated_state_is_412(site: Site) -> None:
    made, tina = hand_in(site.client("ann")), site.client("tina", "instructor")
    etag = claim(tina).headers["ETag"]
    assert decide(tina, made["id"], None, points=1).status_code == 428
    assert decide(tina, made["id"], '"another"', points=1).status_code == 412
    assert decide(tina, made["id"], f'"another", {etag}', points=1).status_code == 200
    late = decide(tina, made["id"], etag, points=0)
    assert late.status_code == 412
    assert late.headers["content-type"] == "application/problem+json"


@pytest.mark.parametrize("points", [-0.5, 1.5, "1", True, None])
def test_points_outside_the_questions_range_are_422(site: Site, points: Any) -> None:
    made, tina = hand_in(site.client("ann")), site.client("tina", "instructor")
    assert decide(tina, made["id"], "*", points=points).status_code == 422
    assert waiting(tina) == [made["id"]]


@pytest.mark.parametrize(
    "body", [{"question": "q4"}, {"quiz": "small", "submission_id": "a"}, {"who": 1}, {"quiz": "a\x00"}, {"quiz": 3}]
)
def test_an_invalid_claim_is_422(teacher: httpx.Client, body: dict[str, Any]) -> None:
    assert claim(teacher, **body).status_code == 422


def test_reviews_are_for_instructors_of_the_course(site: Site) -> None:
    ann, made = site.client("ann"), hand_in(site.client("ann"))
    elsewhere = site.client("eve", "instructor", "another course")
    assert ann.get(f"{API}/reviews").status_code == 403
    assert claim(ann).status_code == decide(ann, made["id"], "*", points=1).status_code == 403
    assert waiting(elsewhere) == []
    assert claim(elsewhere, submission_id=made["id"]).status_code == 404
    assert decide(elsewhere, made["id"], "*", points=1).status_code == 404
    assert site.anonymous().put(f"{API}/submissions/x/review").status_code == 401


def test_the_list_is_oldest_first_in_pages_and_by_question(site: Site) -> None:
    ann, tina = site.client("ann"), site.client("tina", "instructor")
    made = [hand_in(site.client(f"learner{number}"))["id"] for number in range(3)]
    hand_in(ann, "7 ms", "q2")
    first = tina.get(f"{API}/reviews", params={"limit": 2, "quiz": "small"})
    onward = tina.get(first.links["next"]["url"]).json()
    assert [item["id"] for item in first.json()["items"] + onward["items"]] == made
    assert onward["next_cursor"] is None
    assert "answer" not in first.json()["items"][0] or first.json()["items"][0]["answer"] is None
    assert waiting(tina, quiz="small", question="q4") == made
    assert waiting(tina, quiz="small", question="q1") == []
    assert claim(tina, quiz="small", question="q1").status_code == 404


def test_a_script_that_is_still_graded_cannot_be_reviewed(site: Site) -> None:
    """There is no exercise in the small quiz, so a submission is put back by hand."""
    from grader.store import submissions

    made, tina = hand_in(site.client("ann")), site.client("tina", "instructor")
    with site.app.state.services.database.write() as session:
        submissions.put_back(session, made["id"])
    assert claim(tina, submission_id=made["id"]).status_code == 409
    assert decide(tina, made["id"], "*", points=1).status_code == 409


def withdraw(client: httpx.Client, submission_id: str, etag: str | None = "*") -> httpx.Response:
    headers = {} if etag is None else {"If-Match": etag}
    return client.delete(f"{API}/submissions/{submission_id}/review", headers=headers)


def test_a_mark_is_taken_back_and_the_answer_waits_again(either_site: Site) -> None:
    ann, tina = either_site.client("ann"), either_site.client("tina", "instructor")
    made = hand_in(ann)
    assert decide(tina, made["id"], "*", points=1.0, comment="Yes.").status_code == 200
    assert withdraw(tina, made["id"], None).status_code == 428
    assert withdraw(tina, made["id"], '"stale"').status_code == 412
    done = withdraw(tina, made["id"])
    assert (done.status_code, done.json()["status"]) == (200, "needs_review")
    seen = ann.get(f"{API}/submissions/{made['id']}").json()
    assert (seen["revision"], seen["verdict"]["status"], seen["verdict"]["points"]) == (3, "needs_review", 0.0)
    assert "Yes." not in str(seen["verdict"])
    assert waiting(tina) == [made["id"]]
    again = withdraw(tina, made["id"])
    assert (again.status_code, again.json()["detail"]) == (409, "No reviewer's mark counts for this submission.")
    assert decide(tina, made["id"], "*", points=0.5).status_code == 200
    assert waiting(tina) == []


def test_what_the_grader_found_counts_again_and_regrades_apply_to_it(either_site: Site) -> None:
    ann, tina = either_site.client("ann"), either_site.client("tina", "instructor")
    made = hand_in(ann, "b", "q1")
    own = made["verdict"]
    assert decide(tina, made["id"], "*", points=1.0 - own["points"]).status_code == 200
    with either_site.app.state.services.database.read() as session:
        assert find_reviewed(session, [made["id"]]) == {made["id"]}
    assert withdraw(tina, made["id"]).json()["verdict"] == own
    results = either_site.client("lms", "service").get(f"{API}/results").json()["items"]
    assert [result["points"] for result in results] == [own["points"], 1.0 - own["points"], own["points"]]
    with either_site.app.state.services.database.read() as session:
        assert find_reviewed(session, [made["id"]]) == set()
    assert decide(tina, made["id"], "*", points=0.25).status_code == 200
    with either_site.app.state.services.database.read() as session:
        assert find_reviewed(session, [made["id"]]) == {made["id"]}
