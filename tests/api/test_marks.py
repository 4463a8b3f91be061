"""Reviews by rubric, second marks, pseudonyms, heartbeats and saved comments, over HTTP."""

import json
import re
import secrets
import time
from collections.abc import Iterator
from dataclasses import replace
from datetime import timedelta
from typing import Any

import httpx
import pytest

from grader.courses.people.identity import Identity, Role
from grader.courses.reviewing import comments, reviews
from grader.courses.reviewing.blinding import blinded_differences
from grader.errors import Conflict
from grader.gate.admission import PREFIX as API
from grader.settings import Settings
from grader.store.tables import Review, Submission
from support.databases import BACKENDS, database_url
from support.sites import Site, open_site, write_content

ITEMS = [
    {"id": "damping", "title": "Names implicit damping", "points": 3, "group": "Physics"},
    {"id": "bound", "title": "Compares with the bound", "points": 1},
    {"id": "units", "title": "Units are missing", "points": -0.5},
]
QUESTION = {"kind": "open", "id": "why", "q": "Why?", "points": 4, "reference": "SECRET", "rubric": ITEMS}
QUIZZES: dict[str, dict[str, Any]] = {
    "essay": {},
    "named": {"anonymous": False},
    "all": {"policy": {"counts": "average"}},
    "twice": {"second_marking": {"share": 1, "tolerance": 0.5}},
}
"""`essay` is changed by a test, and put back."""


def write_quiz(site: Site, name: str, **changes: Any) -> None:
    quiz = {"id": name, "title": name, "questions": [{**QUESTION, **changes}], **QUIZZES[name]}
    (site.settings.content / "quizzes" / f"{name}.json").write_text(json.dumps(quiz))


@pytest.fixture(scope="module", params=BACKENDS)
def shared(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    folder = tmp_path_factory.mktemp("marks")
    content = write_content(folder / "content")
    for name, rules in QUIZZES.items():
        quiz = {"id": name, "title": name, "questions": [QUESTION], **rules}
        (content / "quizzes" / f"{name}.json").write_text(json.dumps(quiz))
    with (
        database_url(request.param, folder) as url,
        open_site(Settings(content=content, database_url=url, workers=0)) as site,
    ):
        yield site


@pytest.fixture
def site(shared: Site) -> Site:
    """A course of its own."""
    return replace(shared, course=f"course-{secrets.token_hex(4)}")


def hand_in(client: httpx.Client, quiz: str = "essay", answer: str = "Because.") -> dict[str, Any]:
    response = client.post(f"{API}/submissions", json={"quiz": quiz, "question": "why", "answer": answer})
    assert response.status_code == 201
    made: dict[str, Any] = response.json()
    return made


def claim(client: httpx.Client, **body: Any) -> httpx.Response:
    return client.post(f"{API}/reviews:claim", json=body)


def decide(
    client: httpx.Client, submission_id: str, path: str = "review", etag: str = "*", **body: Any
) -> httpx.Response:
    return client.put(f"{API}/submissions/{submission_id}/{path}", json=body, headers={"If-Match": etag})


def listed(client: httpx.Client, path: str = "/reviews", **query: Any) -> list[dict[str, Any]]:
    response = client.get(f"{API}{path}", params=query)
    assert response.status_code == 200, response.text
    items: list[dict[str, Any]] = response.json()["items"]
    return items


def ids(items: list[dict[str, Any]]) -> list[str]:
    return [item["id"] for item in items]


def audited(client: httpx.Client) -> list[str]:
    return [entry["action"] for entry in listed(client, "/audit")]


def test_ticked_items_give_points_and_the_learner_sees_their_titles(site: Site) -> None:
    ann, tina = site.client("ann"), site.client("tina", "instructor")
    made = hand_in(ann)
    held = claim(tina).json()
    assert [item["id"] for item in held["rubric"]] == ["damping", "bound", "units"]
    assert (held["rubric"][0]["group"], held["reference"]) == ("Physics", "SECRET")
    done = decide(tina, made["id"], rubric=["units", "damping"], comment="Well put.")
    assert (done.status_code, done.json()["verdict"]["points"]) == (200, 2.5)
    seen = ann.get(f"{API}/submissions/{made['id']}")
    (review,) = seen.json()["verdict"]["findings"]
    assert [item["title"] for item in review["measured"]["rubric"]] == [ITEMS[0]["title"], ITEMS[2]["title"]]
    assert "Compares" not in seen.text
    by_hand = decide(tina, made["id"], rubric=["damping"], points=1.25).json()["verdict"]
    assert (by_hand["points"], by_hand["findings"][0]["measured"]["by_hand"]) == (1.25, True)


@pytest.mark.parametrize(
    "body",
    [{}, {"comment": "x"}, {"rubric": ["unit"]}, {"rubric": "units"}, {"rubric": ["x" * 65]}, {"rubric": [1]},
     {"rubric": ["units"] * 101}, {"rubric": [], "points": 5}, {"points": 1, "comment": "x" * 10_001},
     {"points": 1, "comment": "a\x00b"}],
)  # fmt: skip
def test_a_mark_that_means_nothing_is_422(site: Site, body: dict[str, Any]) -> None:
    made, tina = hand_in(site.client("ann")), site.client("tina", "instructor")
    assert decide(tina, made["id"], **body).status_code == 422
    assert ids(listed(tina)) == [made["id"]]


def test_items_of_a_question_without_rubric_are_422(site: Site) -> None:
    ann, tina = site.client("ann"), site.client("tina", "instructor")
    made = ann.post(f"{API}/submissions", json={"quiz": "small", "question": "q4", "answer": "x"}).json()
    refused = decide(tina, made["id"], rubric=["damping"])
    assert (refused.status_code, "has no rubric" in refused.text) == (422, True)


def points_of(client: httpx.Client, submission_id: str) -> tuple[float, int]:
    seen = client.get(f"{API}/submissions/{submission_id}").json()
    return seen["verdict"]["points"], seen["revision"]


@pytest.mark.slow
def test_changed_points_of_an_item_recompute_the_reviews_once(site: Site) -> None:
    ann, bob, tina = site.client("ann"), site.client("bob"), site.client("tina", "instructor")
    ticked, by_hand = hand_in(ann)["id"], hand_in(bob)["id"]
    decide(tina, ticked, rubric=["damping"], comment="Well put.")
    decide(tina, by_hand, rubric=["damping"], points=3)
    try:
        write_quiz(site, "essay", rubric=[{**ITEMS[0], "points": 2}, {**ITEMS[1], "points": 2}])
        assert tina.post(f"{API}/content:reload").status_code == 200
        deadline = time.monotonic() + 60
        while points_of(ann, ticked) != (2, 3) and time.monotonic() < deadline:
            time.sleep(0.05)
        assert points_of(ann, ticked) == (2, 3)
        assert points_of(bob, by_hand) == (3, 2)
        again = tina.post(f"{API}/reviews:recompute", json={"quiz": "essay", "question": "why"})
        assert (again.status_code, again.json()) == (200, {"changed": 0})
        entry = next(one for one in listed(tina, "/audit") if one["action"] == "review recomputed")
        assert (entry["subject"], entry["detail"]) == (ticked, {"before": 3, "after": 2})
        assert ann.get(f"{API}/quizzes/essay").json()["questions"][0]["result"]["points"] == 2
    finally:
        write_quiz(site, "essay")
        tina.post(f"{API}/content:reload")


def test_only_instructors_of_the_course_recompute_and_only_what_exists(site: Site) -> None:
    body = {"quiz": "essay", "question": "why"}
    assert site.client("ann").post(f"{API}/reviews:recompute", json=body).status_code == 403
    tina = site.client("tina", "instructor")
    assert tina.post(f"{API}/reviews:recompute", json={**body, "question": "gone"}).status_code == 404


def test_reviewers_see_a_pseudonym_in_place_of_the_name(site: Site) -> None:
    ann, bob, tina = site.client("ann-learner"), site.client("bob"), site.client("tina", "instructor")
    first, other = hand_in(ann)["id"], hand_in(bob)["id"]
    elsewhere = hand_in(ann, "all")["id"]
    learner = ann.get(f"{API}/submissions/{first}").json()["learner"]
    shown = {item["id"]: item for item in listed(tina)}
    assert {one["learner"] for one in shown.values()} == {None}
    names = {one: shown[one]["user"] for one in (first, other, elsewhere)}
    assert len(set(names.values())) == 3  # one per learner and quiz
    pages = [
        tina.get(f"{API}/reviews"),
        claim(tina, submission_id=first),
        tina.get(f"{API}/submissions"),
        tina.get(f"{API}/submissions/{first}"),
        tina.get(f"{API}/submissions/{first}/events"),
        tina.get(f"{API}/submissions/{first}/review"),
        decide(tina, first, points=1),
    ]
    for page in pages:
        assert "ann-learner" not in page.text
        assert learner not in page.text
        assert names[first] in page.text
    newer = hand_in(ann)["id"]
    assert next(item["user"] for item in listed(tina) if item["id"] == newer) == names[first]
    assert names[first] not in ann.get(f"{API}/submissions/{first}").text + ann.get(f"{API}/submissions").text


def test_a_search_by_name_finds_nothing_that_waits_anonymously(site: Site) -> None:
    ann, tina = site.client("ann"), site.client("tina", "instructor")
    made, named = hand_in(ann)["id"], hand_in(ann, "named")["id"]
    assert ids(listed(tina, user="ann")) == [named]
    learner = ann.get(f"{API}/submissions/{made}").json()["learner"]
    assert ids(listed(tina, learner=learner)) == [named]
    assert ids(listed(tina, learner="0" * 32)) == []
    assert listed(tina, quiz="named")[0]["user"] == "ann"
    # Who asks for the answers of a learner by name knows whose they are.
    assert {item["id"]: item["user"] for item in listed(tina, "/submissions", user="ann")} == {
        made: "ann",
        named: "ann",
    }
    assert tina.get(f"{API}/submissions/{named}").json()["user"] == "ann"


def test_after_the_decision_instructors_see_the_name(site: Site) -> None:
    made, tina = hand_in(site.client("ann"))["id"], site.client("tina", "instructor")
    decide(tina, made, points=1)
    assert tina.get(f"{API}/submissions/{made}").json()["user"] == "ann"


def test_only_the_newest_attempt_waits_unless_all_count(site: Site) -> None:
    ann, tina = site.client("ann"), site.client("tina", "instructor")
    old, new = hand_in(ann)["id"], hand_in(ann)["id"]
    both = [hand_in(ann, "all")["id"] for _ in range(2)]
    assert ids(listed(tina)) == [new, *both]
    assert ann.get(f"{API}/submissions/{old}").json()["status"] == "needs_review"
    assert claim(tina, quiz="essay").json()["id"] == new
    assert claim(tina, submission_id=old).status_code == 200  # by its id any answer can be reviewed


def test_a_heartbeat_prolongs_a_claim_until_it_has_ended(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    made = hand_in(site.client("ann"))["id"]
    tina, tom = site.client("tina", "instructor"), site.client("tom", "instructor")
    until = claim(tina).json()["claim"]["expires_at"]
    beat = tina.post(f"{API}/reviews:heartbeat", json={"submission_id": made})
    assert (beat.status_code, beat.json()["expires_at"] > until) == (200, True)
    assert claim(tina, submission_id=made).json()["claim"]["expires_at"] > beat.json()["expires_at"]
    assert tom.post(f"{API}/reviews:heartbeat", json={"submission_id": made}).status_code == 409
    monkeypatch.setattr(reviews, "CLAIM", timedelta(seconds=-1))
    claim(tina, submission_id=made)
    assert tina.post(f"{API}/reviews:heartbeat", json={"submission_id": made}).status_code == 409
    assert tina.post(f"{API}/reviews:heartbeat", json={"submission_id": "no"}).status_code == 404
    assert audited(tina).count("review claimed") == 1  # heartbeats are not told


def test_a_released_claim_lets_others_in(site: Site) -> None:
    made = hand_in(site.client("ann"))["id"]
    tina, tom = site.client("tina", "instructor"), site.client("tom", "instructor")
    claim(tina)
    assert tom.post(f"{API}/reviews:release", json={"submission_id": made}).status_code == 204
    assert claim(tom, submission_id=made).status_code == 409
    for _ in range(2):
        assert tina.post(f"{API}/reviews:release", json={"submission_id": made}).status_code == 204
    assert claim(tom).json()["id"] == made
    assert "review released" in audited(tina)


def test_a_claim_is_of_a_person_and_not_of_a_name(site: Site) -> None:
    """Two instructors may bear the same name."""
    made = hand_in(site.client("ann"))["id"]
    assert site.course is not None
    one, other = (Identity(f"id{number}", "tina", Role.INSTRUCTOR, site.course) for number in range(2))
    with site.app.state.services.database.write() as session:
        submission = session.get_one(Submission, made)
        reviews.claim(session, one, submission)
        with pytest.raises(Conflict):
            reviews.claim(session, other, submission)


@pytest.mark.slow
def test_a_second_reviewer_marks_blind_and_a_third_decision_settles(site: Site) -> None:
    ann = site.client("ann")
    tina, tom, tess = (site.client(name, "instructor") for name in ("tina", "tom", "tess"))
    made = hand_in(ann, "twice")["id"]
    claim(tina)
    decide(tina, made, rubric=["damping"], comment="FIRST")
    assert listed(tina, second=True) == []
    assert ids(listed(tom, second=True)) == [made]
    assert claim(tina, submission_id=made, second=True).status_code == 409
    held = claim(tom, second=True)
    assert (held.status_code, held.json()["verdict"]["status"]) == (200, "needs_review")
    paths = ("/submissions", f"/submissions/{made}", f"/submissions/{made}/events", "/reviews?second=true")
    seen = "".join(tom.get(API + path).text for path in paths)
    assert "FIRST" not in tom.get(f"{API}/submissions/{made}/review").text
    assert "FIRST" not in seen + held.text
    assert "damping" not in seen
    assert "FIRST" in tina.get(f"{API}/submissions/{made}").text
    assert decide(tina, made, "review/second", points=1).status_code == 409
    before = ann.get(f"{API}/submissions/{made}")
    marked = decide(tom, made, "review/second", held.headers["etag"], points=1, comment="SECOND")
    assert (marked.status_code, marked.json()["agrees"]) == (200, False)
    assert decide(tess, made, "review/second", points=1).status_code == 409
    after = ann.get(f"{API}/submissions/{made}")
    assert (after.content, after.headers["etag"]) == (before.content, before.headers["etag"])
    (disagreement,) = listed(tess, "/reviews/disagreements")
    assert (disagreement["first"], disagreement["second"]["points"]) == ({"by": "tina", "points": 3}, 1)
    assert (disagreement["second"]["comment"], disagreement["user"] == "ann") == ("SECOND", False)
    assert points_of(ann, made) == (3, 2)  # the first mark counts meanwhile
    for own in (tina, tom):
        refused = decide(own, made, points=4)
        assert (refused.status_code, "a third reviewer decides" in refused.text) == (409, True)
        assert claim(own, submission_id=made).status_code == 409
    assert decide(tess, made, points=2).status_code == 200
    assert listed(tess, "/reviews/disagreements") == []
    assert points_of(ann, made) == (2, 3)
    assert "marked a second time" in audited(tina)


def test_two_reviewers_alone_decide_between_their_marks(site: Site) -> None:
    made = hand_in(site.client("ann"), "twice")["id"]
    tina, tom = site.client("tina", "instructor"), site.client("tom", "instructor")
    decide(tina, made, rubric=["damping"])
    assert decide(tom, made, "review/second", points=1).json()["agrees"] is False
    assert decide(tom, made, points=2).status_code == 200
    assert points_of(site.client("ann"), made) == (2, 3)


def test_marks_within_the_tolerance_agree(site: Site) -> None:
    made = hand_in(site.client("ann"), "twice")["id"]
    tina, tom = site.client("tina", "instructor"), site.client("tom", "instructor")
    decide(tina, made, rubric=["damping"])
    assert decide(tom, made, "review/second", rubric=["damping", "units"]).json()["agrees"]
    assert listed(tom, "/reviews/disagreements") == listed(tom, second=True) == []


@pytest.mark.parametrize(("etag", "status"), [('"another"', 412), (None, 428)])
def test_a_second_mark_names_the_state_that_it_is_for(site: Site, etag: str | None, status: int) -> None:
    made = hand_in(site.client("ann"), "twice")["id"]
    tina, tom = site.client("tina", "instructor"), site.client("tom", "instructor")
    decide(tina, made, points=1)
    headers = {} if etag is None else {"If-Match": etag}
    path = f"{API}/submissions/{made}/review/second"
    assert tom.put(path, json={"points": 1}, headers=headers).status_code == status


def test_comments_are_saved_changed_used_and_deleted(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    tina, tom = site.client("tina", "instructor"), site.client("tom", "instructor")
    at, path = {"quiz": "essay", "question": "why"}, f"{API}/reviews/comments"
    made = tina.post(path, json={**at, "text": " Which bound? "})
    assert (made.status_code, made.json()["text"], made.json()["saved_by"]) == (201, "Which bound?", "tina")
    changed = tom.put(f"{path}/{made.json()['id']}", json={"text": "Which bound, and why?"})
    assert (changed.json()["text"], changed.json()["saved_by"]) == ("Which bound, and why?", "tom")
    assert listed(tina, "/reviews/comments", **at) == [changed.json()]
    assert listed(tina, "/reviews/comments", quiz="essay", question="other") == []
    hand_in(site.client("ann"))
    assert claim(tina).json()["comments"] == [changed.json()]
    monkeypatch.setattr(comments, "COMMENTS_MAX", 1)
    assert tina.post(path, json={**at, "text": "one more"}).status_code == 409
    for client, status in [(site.client("ann"), 403), (site.client("eve", "instructor", "another"), 404)]:
        assert client.put(f"{path}/{made.json()['id']}", json={"text": "x"}).status_code == status
        assert client.delete(f"{path}/{made.json()['id']}").status_code == status
    assert [tina.delete(f"{path}/{made.json()['id']}").status_code for _ in range(2)] == [204, 404]
    assert {"comment saved", "comment changed", "comment deleted"} <= set(audited(tina))


@pytest.mark.parametrize("text", ["", "  ", "x" * 2001, "a\x00b", 3])
def test_a_comment_is_a_text_of_some_length(site: Site, text: Any) -> None:
    tina = site.client("tina", "instructor")
    body = {"quiz": "essay", "question": "why", "text": text}
    assert tina.post(f"{API}/reviews/comments", json=body).status_code == 422
    assert tina.post(f"{API}/reviews/comments", json={**body, "text": "x", "quiz": "gone"}).status_code == 404


def test_nothing_but_a_search_by_name_joins_an_answer_under_review_to_its_learner(site: Site) -> None:
    ann, tina = site.client("ann-learner"), site.client("tina", "instructor")
    choice = {"quiz": "small", "question": "q1", "answer": 1}
    chosen = ann.post(f"{API}/submissions", json=choice).json()["id"]
    decided, waiting = hand_in(ann)["id"], hand_in(ann)["id"]
    decide(tina, decided, points=1)
    names = {item["id"]: item["user"] for item in listed(tina, "/submissions")}
    assert names[chosen] == "ann-learner"
    assert names[decided] == names[waiting] != "ann-learner"  # else one name would tell the other
    body = {"quiz": "essay", "scope": "all", "dry_run": True}
    regrade = tina.post(f"{API}/regrades", json=body).json()["id"]
    (difference,) = tina.get(f"{API}/regrades/{regrade}").json()["items"]
    assert (difference["user"], difference["learner"]) == (names[waiting], None)
    assert "looked up" not in str(audited(tina))
    listed(tina, "/submissions", user="ann-learner")
    assert audited(tina)[0] == "answers under review looked up by name"
    decide(tina, waiting, points=2)
    names = {item["id"]: item["user"] for item in listed(tina, "/submissions")}
    assert set(names.values()) == {"ann-learner"}
    (difference,) = tina.get(f"{API}/regrades/{regrade}").json()["items"]
    assert difference["user"] == "ann-learner"


def test_nobody_overwrites_a_first_mark_that_they_may_not_see(site: Site) -> None:
    ann, tina, tom = site.client("ann"), site.client("tina", "instructor"), site.client("tom", "instructor")
    made = hand_in(ann, "twice")["id"]
    assert decide(tina, made, points=3).status_code == 200
    refused = decide(tom, made, points=1)
    assert (refused.status_code, "give yours as the second" in refused.json()["detail"]) == (409, True)
    taken = tom.delete(f"{API}/submissions/{made}/review", headers={"If-Match": "*"})
    assert (taken.status_code, "give yours as the second" in taken.json()["detail"]) == (409, True)
    assert decide(tina, made, points=2).status_code == 200  # one's own
    assert decide(tom, made, "review/second", points=2).json()["agrees"]
    assert tom.delete(f"{API}/submissions/{made}/review", headers={"If-Match": "*"}).status_code == 200


def test_nobody_but_the_first_reviewer_sees_the_first_mark_before_the_second(site: Site) -> None:
    ann = site.client("ann")
    tina, tom = site.client("tina", "instructor"), site.client("tom", "instructor")
    made = hand_in(ann, "twice")["id"]
    decide(tina, made, points=3.25, comment="FIRST")
    paths = ("/gradebook.csv?quiz=twice", "/quizzes/twice/statistics", "/audit")

    def told(client: httpx.Client) -> list[bool]:
        return [bool(re.search(r"(?<![\d.])(3\.25|0\.8125)(?!\d)", client.get(API + path).text)) for path in paths]

    assert told(tina) == [True] * 3
    assert told(tom) == [False] * 3
    assert "3.25" in site.client("lms", "service").get(f"{API}/gradebook.csv?quiz=twice").text
    assert decide(tom, made, "review/second", points=3).status_code == 200
    assert told(tom) == [True] * 3


@pytest.mark.parametrize(("by", "form"), [("question", "generic"), ("quiz", "generic"), ("quiz", "canvas")])
def test_a_sum_without_a_first_mark_that_is_unseen_is_an_empty_cell(site: Site, by: str, form: str) -> None:
    ann = site.client("ann")
    tina, tom = site.client("tina", "instructor"), site.client("tom", "instructor")
    decide(tina, hand_in(ann, "twice")["id"], points=3)

    def cells(client: httpx.Client, quiz: str) -> list[str]:
        path = f"{API}/gradebook.csv?quiz={quiz}&by={by}&format={form}"
        [row] = [line for line in client.get(path).text.splitlines() if line.startswith("ann")]
        return row.split(",")[3 if form == "generic" else 5 :]

    assert cells(tina, "twice")[:2] == ["3", "3"][: len(cells(tina, "twice"))]
    assert cells(tom, "twice")[:2] == ["", ""][: len(cells(tom, "twice"))]
    hand_in(ann, "essay")
    assert cells(tom, "essay") == cells(tina, "essay")


def test_a_regrade_tells_no_first_mark_that_is_unseen(site: Site) -> None:
    ann, tina = site.client("ann"), site.client("tina", "instructor")
    made = hand_in(ann, "twice")["id"]
    decide(tina, made, points=3)
    learner = ann.get(f"{API}/submissions/{made}").json()["learner"]
    submission = {"submission_id": made, "outcome": "reviewed", "old": {"status": "partial", "points": 3}, "new": None}
    difference = {"learner": learner, "user": "ann", "question": "why", "before": 3.0, "after": 3.0, "difference": 0.0}
    desk = site.app.state.services.desk_of(site.course)
    assert site.course is not None
    with desk.database.read() as session:
        first = session.get_one(Review, made).reviewer
        for reviewer, seen in ((first, 3.0), ("other", None)):
            who = Identity(reviewer, reviewer, Role.INSTRUCTOR, site.course)
            items = [{**difference, "submissions": [submission]}]
            (told,) = blinded_differences(desk, session, who, "twice", items)
            assert (told["before"], told["after"], told["user"] == "ann") == (seen, seen, False)
            assert (told["submissions"][0]["old"] is None) == (seen is None)
