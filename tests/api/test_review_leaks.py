"""Before the feedback, a learner's documents are the same with and without a review, to the last byte."""

import json
import re
import secrets
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import httpx
import pytest
from hypothesis import Phase, given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from api.test_leaks import API, POLICIES, a_session, get_paths, normal
from grader.courses.answering import results
from grader.courses.people.identity import COOKIE, Identity, Role
from grader.courses.reviewing import reviews
from grader.courses.rules.rubric import Mark
from grader.domain.verdict import Status, Verdict
from grader.settings import Settings
from grader.store.reviewing import reviews as stored
from grader.store.tables import Submission
from support.databases import database_url
from support.sites import Site, open_site, write_content

pytestmark = pytest.mark.slow

RUBRIC = [{"id": "a", "title": "LEAK", "points": 1}, {"id": "b", "title": "LEAK", "points": -0.5}]
NAMES = ("number", "choice", "prediction", "text", "script")
"""As test_leaks.py looks for them; here all are texts for a reviewer."""


@pytest.fixture(scope="module", params=["postgresql"])
def shared(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    folder = tmp_path_factory.mktemp("leaks")
    content = write_content(folder / "content")
    questions = [{"kind": "open", "id": name, "q": "Why?", "reference": "LEAK", "rubric": RUBRIC} for name in NAMES]
    for name, policy in POLICIES.items():
        quiz = {"id": name, "title": name, "questions": questions, "second_marking": {"share": 1}}
        (content / "quizzes" / f"{name}.json").write_text(json.dumps({**quiz, "policy": policy}))
    with (
        database_url(request.param, folder) as url,
        open_site(Settings(content=content, database_url=url, workers=0)) as site,
    ):
        yield site


def documents(site: Site, client: httpx.Client, quiz: str, made: list[str]) -> dict[str, tuple[int, str]]:
    """Everything that the learner can fetch, streams also from after the first event on, with ETags."""
    by_path = {}
    streams = [f"{API}/submissions/{one}/events" for one in made]
    requests: list[tuple[str, dict[str, str]]] = [(path, {}) for path in get_paths(site, quiz, made)]
    for path, headers in [*requests, *((path, {"Last-Event-ID": "1"}) for path in streams)]:
        response = client.get(path, headers={**headers, "X-Request-ID": "the-same-in-all"})
        told = response.text + response.headers.get("etag", "")
        by_path[f"{path} {headers}"] = (response.status_code, told)
    return by_path


def mark(site: Site, submission_id: str, deeds: list[tuple[str, Any]]) -> None:
    """What reviewers do with a submission; deeds that are not possible then are left out."""
    desk = site.app.state.services.desk_of(site.course)
    assert site.course is not None
    for name, given_mark in deeds:
        who = Identity(name, name, Role.INSTRUCTOR, site.course)
        with desk.database.write() as session:
            submission = session.get_one(Submission, submission_id)
            desk.hold(session, submission)
            kept = stored.find_review(session, submission_id)
            if given_mark is None:
                reviews.claim(session, who, submission)
                reviews.release(session, who, submission)
            elif kept is not None and kept.second == stored.WAITING and kept.reviewer != name:
                reviews.mark_second(desk, session, who, submission, given_mark)
            else:
                reviews.decide(desk, session, who, submission, given_mark)


marks = st.one_of(
    st.none(),
    st.builds(Mark, st.none(), st.floats(0, 1), st.just("LEAK")),
    st.builds(Mark, st.sampled_from([(), ("a",), ("a", "b")]), st.none(), st.just("LEAK")),
)
deeds = st.lists(st.tuples(st.sampled_from(["tina", "tom"]), marks), min_size=1, max_size=4)
graded = st.sampled_from([None, Status.CRASHED, Status.PARTIAL])
"""What the grader may have made of the answer before the review, in place of leaving it to a person."""


@given(quiz=st.sampled_from(sorted(POLICIES)), done=st.tuples(deeds, deeds), earlier=graded)
@hypothesis_settings(max_examples=4, phases=[Phase.explicit, Phase.reuse, Phase.generate])
def test_before_the_feedback_no_document_tells_of_a_review(
    shared: Site, quiz: str, done: tuple[list[Any], list[Any]], earlier: Status | None
) -> None:
    site = replace(shared, course=f"course-{secrets.token_hex(6)}")
    assert site.course is not None
    client = site.client("ann")
    client.cookies.set(COOKIE, a_session(site, site.course))
    made = []
    for question in ("text", "script"):
        answer = {"quiz": quiz, "question": question, "answer": "Because."}
        made.append(client.post(f"{API}/submissions", json=answer).json()["id"])
    if earlier is not None:
        regrade(site, made[1], earlier)
    before = documents(site, client, quiz, made)
    for one, what in zip(made, done, strict=True):
        mark(site, one, what)
    assert documents(site, client, quiz, made) == before
    assert "LEAK" not in str(before)
    assert not re.search(r"tina|tom\b", normal(str(before), {}))


def regrade(site: Site, submission_id: str, status: Status) -> None:
    """A verdict of the grader's own."""
    desk = site.app.state.services.desk_of(site.course)
    verdict = Verdict(status=status, points=0.5, max_points=1.0, diagnosis="Line 1 raises ValueError.")
    with desk.database.write() as session:
        submission = session.get_one(Submission, submission_id)
        results.append_verdict(desk.database, desk.library, session, submission, verdict, cause="regrade")


def test_once_published_the_review_is_seen(shared: Site) -> None:
    """The comparison itself can tell a review."""
    site = replace(shared, course=f"course-{secrets.token_hex(6)}")
    ann, tina = site.client("ann"), site.client("tina", "instructor")
    answer = {"quiz": "publish", "question": "text", "answer": "Because."}
    made = ann.post(f"{API}/submissions", json=answer).json()["id"]
    mark(site, made, [("tina", Mark(("a",), None, "LEAK"))])
    before = documents(site, ann, "publish", [made])
    assert tina.put(f"{API}/quizzes/publish/publication").status_code == 204
    after = documents(site, ann, "publish", [made])
    assert "LEAK" in str(after)
    assert "LEAK" not in str(before)
    assert "graded" in after[f"{API}/submissions/{made}/events {{'Last-Event-ID': '1'}}"][1]
