"""Before the feedback a learner can fetch nothing that depends on the key.

Two servers differ in the keys of their quizzes alone. A learner does the same on both, so every document that can be
fetched must be the same, apart from ids and times.
"""

import json
import re
import secrets
from collections.abc import Iterator
from contextlib import ExitStack
from datetime import UTC, datetime, timedelta
from typing import Any

import httpx
import pytest
from hypothesis import Phase, given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from grader.courses.answering import results
from grader.courses.people.identity import COOKIE, Role
from grader.courses.people.sign_in import create_sign_in_code, redeem_sign_in_code
from grader.domain.verdict import Finding, Status, Verdict
from grader.settings import Settings
from grader.store.tables import Submission
from support.databases import database_url
from support.sites import Site, open_site, write_content

pytestmark = pytest.mark.slow

API = "/api/v1"
SOON = datetime.now(UTC) + timedelta(days=30)
POLICIES: dict[str, dict[str, Any]] = {
    "due": {"due": SOON.isoformat(), "feedback": "after_due", "attempts": 3},
    "publish": {"feedback": "after_publish", "solutions": "with_feedback"},
}
QUESTIONS = ("number", "choice", "prediction", "text", "script")
KEYS: tuple[dict[str, Any], ...] = (
    {"number": 5, "choice": 0, "prediction": 1, "explain": "KEYED zero"},
    {"number": 8, "choice": 1, "prediction": 0, "explain": "KEYED one"},
)


def a_quiz(name: str, key: dict[str, Any]) -> dict[str, Any]:
    lab = {"model": "pendulum_servo", "setup": "data.qpos[0] = 1", "readouts": [{"label": "a", "expr": "data.qpos[0]"}]}
    questions: list[dict[str, Any]] = [
        {"kind": "numeric", "id": "number", "q": "How long?", "answer": key["number"], "unit": "ms"},
        {"kind": "mcq", "id": "choice", "q": "Which?", "options": ["a", "b", "c"], "answer": key["choice"]},
        {
            "kind": "predict",
            "id": "prediction",
            "q": "And?",
            "options": ["x", "y"],
            "answer": key["prediction"],
            "sim": lab,
        },
        {"kind": "open", "id": "text", "q": "Why?", "reference": key["explain"]},
        {"kind": "open", "id": "script", "q": "A stand-in for what is graded later."},
    ]
    told = [{**question, "explain": key["explain"]} for question in questions]
    return {"id": name, "title": "Exam", "policy": POLICIES[name], "questions": told}


def of_direction(answer: float) -> dict[str, Any]:
    """A quiz that tells the direction of an error alone."""
    asked = {"kind": "numeric", "id": "number", "q": "How long?", "answer": answer, "unit": "ms", "reveal": "direction"}
    return {"id": "direction", "title": "Steps", "questions": [asked | {"explain": "KEYED", "attempts": 9}]}


@pytest.fixture(scope="module", params=["sqlite"])
def pair(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[list[Site]]:
    """The two servers; on PostgreSQL each has a schema of its own."""
    with ExitStack() as stack:
        sites = []
        for key in KEYS:
            folder = tmp_path_factory.mktemp("site")
            content = write_content(folder / "content")
            for name in POLICIES:
                (content / "quizzes" / f"{name}.json").write_text(json.dumps(a_quiz(name, key)))
            (content / "quizzes" / "direction.json").write_text(json.dumps(of_direction(key["number"])))
            url = stack.enter_context(database_url(request.param, folder))
            sites.append(stack.enter_context(open_site(Settings(content=content, database_url=url, workers=0))))
        sites[1].app.openapi_schema = sites[0].app.openapi()  # the routes are the same, and it takes a second
        yield sites


typed = st.sampled_from(["5 ms", "8 ms", "0.005 s", "0.008 s", "6 ms", "five", "5000", "8 kg", ""])
ANSWERS = {
    "number": typed,
    "choice": st.integers(0, 3),
    "prediction": st.integers(0, 1),
    "text": st.sampled_from(["Because.", ""]),
}
deeds = st.lists(
    st.sampled_from(sorted(ANSWERS)).flatmap(lambda name: st.tuples(st.just(name), ANSWERS[name])),
    min_size=1,
    max_size=6,
)
outcomes = st.tuples(st.sampled_from(["correct", "partial", "incorrect", "needs_review"]), st.floats(0, 1))


def a_verdict(status: str, points: float) -> Verdict:
    """What a script or a reviewer might make of the same answer."""
    finding = Finding(id="case", title="KEYED", passed=None, points=points, max_points=1.0, message="KEYED")
    return Verdict(status=Status(status), points=points, max_points=1.0, findings=(finding,), diagnosis="KEYED",
                   explain="KEYED", evidence={"stability": points, "angles": points})  # fmt: skip


def judge(site: Site, submission_id: str, verdict: Verdict, cause: str) -> None:
    services = site.app.state.services
    with services.database.write() as session:
        submission = session.get_one(Submission, submission_id)
        results.append_verdict(
            services.database,
            services.content.get(submission.course).library,
            session,
            submission,
            verdict,
            cause=cause,
            reviewer="tina",
        )


def reads(route: Any) -> bool:
    return "GET" in (getattr(route, "methods", None) or ())


def get_paths(site: Site, quiz: str, made: list[str]) -> list[str]:
    """Every GET route of the app, of the API and of the pages, with each parameter that the learner may know."""
    documented = site.app.openapi()["paths"]
    pages = {inner.path for route in site.app.routes for inner in walk(route) if reads(inner)}
    paths = {path for path in documented if "get" in documented[path]}
    paths |= {path for path in pages if API + path not in paths}
    for name, values in {
        "quiz_id": [quiz],
        "question_id": QUESTIONS,
        "submission_id": made,
        "regrade_id": ["f" * 32],
        "webhook_id": ["f" * 32],
        "learner": ["f" * 32],
        "path": ["page.js"],
        "lesson": ["questions"],
        "attempt": made,
        "name": ["motion", "order"],
        "sha256": ["0" * 64],
    }.items():
        paths = {re.sub(rf"\{{{name}(:path)?\}}", value, one) for one in paths for value in values}
    lists = {f"{API}/submissions?quiz={quiz}", f"{API}/submissions?quiz={quiz}&question=choice", f"/?quiz={quiz}",
             f"{API}/gradebook.csv?quiz={quiz}"}  # fmt: skip
    assert not [path for path in paths if "{" in path], paths
    return sorted(path for path in paths | lists if not path.startswith(SAME_FOR_ALL))


def walk(route: Any) -> Iterator[Any]:
    """The routes within a route: FastAPI may keep included routers as they are."""
    inner = getattr(route, "routes", None)
    if inner is None and hasattr(route, "original_router"):
        inner = route.original_router.routes
    if inner is None:
        yield route
    else:
        for one in inner:
            yield from walk(one)


SAME_FOR_ALL = ("/healthz", "/readyz", "/metrics", "/openapi.json", "/static/", "/favicon.ico", "/lti/keys.json")
"""What knows no learner."""

VARIES = [
    (re.compile(r"\d\d? \w{3} \d{4}, \d\d:\d\d UTC"), "TIME"),
    (re.compile(r'(?:"learner": ?|data-learner=|name="learner" value=)"[0-9a-f]{32}"'), "LEARNER"),
    (re.compile(r'"id": ?"[0-9a-f]{32}"(?=, ?"user")'), "LEARNER"),
    (re.compile(r"course-[0-9a-f]{12}"), "COURSE"),
    (re.compile(r"\d\d \w{3}, \d\d:\d\d UTC"), "TIME"),
    (re.compile(r"[\d.]+\u202fms (?=your script|of it|our own)"), "MS"),
    (re.compile(r"\d{4}-\d\d-\d\dT[\d:.]+(Z|\+00:00)"), "TIME"),
    (re.compile(r'"(?:total|script_\w+|judge_\w+)": ?[\d.]+'), "MS"),
    (re.compile(r'"(?:content_digest|digest)": ?"[^"]*"'), "DIGEST"),
    (re.compile(r'"request_id": ?"[0-9a-f]{32}"'), "REQUEST"),
    (re.compile(r'"[0-9a-f]{24}"$'), "TAG"),  # a digest of the body before it, which is compared itself
    (re.compile(r"/devices/[0-9a-f]+/revoke"), "REVOKE"),
    (re.compile(r"127\.0\.0\.1:\d+"), "HOST"),
    (re.compile(r"at:[^\"&]*|cursor=[\w-]+|\"next_cursor\": ?\"[\w-]+\""), "CURSOR"),
]


def normal(text: str, names: dict[str, str]) -> str:
    """A document without ids and times."""
    for own, common in names.items():
        text = text.replace(own, common)
    for pattern, word in VARIES:
        text = pattern.sub(word, text)
    return text


def documents(site: Site, client: httpx.Client, quiz: str, made: list[str]) -> dict[str, tuple[int, str]]:
    names = {own: f"submission-{n}" for n, own in enumerate(made)} | {
        own[-8:]: f"tag-{n}" for n, own in enumerate(made)
    }
    by_path = {}
    for path in get_paths(site, quiz, made):
        response = client.get(path)
        told = response.text + response.headers.get("etag", "")
        by_path[normal(path, names)] = (response.status_code, normal(told, names))
    return by_path


def a_session(site: Site, course: str) -> str:
    """A browser session of the learner, for the pages."""
    with site.app.state.services.database.write() as session:
        code = create_sign_in_code(session, "ann", Role.STUDENT, course)
        return redeem_sign_in_code(session, code).secret


def act(site: Site, quiz: str, deeds: list[tuple[str, Any]], verdicts: list[tuple[str, float]]) -> dict[str, Any]:
    """What the learner does, and what they can fetch afterwards."""
    course = f"course-{secrets.token_hex(6)}"
    client = site.client("ann", course=course)
    client.cookies.set(COOKIE, a_session(site, course))
    made, sent = [], []
    for question, answer in [*deeds, *(("script", "print()") for _ in verdicts[:2])]:
        response = client.post(f"{API}/submissions", json={"quiz": quiz, "question": question, "answer": answer})
        sent.append(response)
        if response.status_code == 201:
            made.append((response.json()["id"], question))
    scripts = [one for one, question in made if question == "script"]
    for one, (status, points) in zip(scripts, verdicts, strict=False):
        judge(site, one, a_verdict(status, points), "regrade")
    ids = [one for one, _ in made]
    names = {own: f"submission-{n}" for n, own in enumerate(ids)} | {own[-8:]: f"tag-{n}" for n, own in enumerate(ids)}
    lab = client.post(f"{API}/labs:run", json={"quiz": quiz, "question": "prediction"})
    replies = [(one.status_code, normal(one.text + one.headers.get("etag", ""), names)) for one in [*sent, lab]]
    return {"replies": replies, **documents(site, client, quiz, ids)}


@given(
    quiz=st.sampled_from(sorted(POLICIES)),
    done=deeds,
    verdicts=st.tuples(st.lists(outcomes, min_size=2, max_size=2), st.lists(outcomes, min_size=2, max_size=2)),
)
@hypothesis_settings(max_examples=4, phases=[Phase.explicit, Phase.reuse, Phase.generate])
def test_before_the_feedback_no_document_depends_on_the_key(
    pair: list[Site], quiz: str, done: list[tuple[str, Any]], verdicts: tuple[list[Any], list[Any]]
) -> None:
    one, other = (act(site, quiz, done, judged) for site, judged in zip(pair, verdicts, strict=True))
    assert one.keys() == other.keys()
    for path, document in one.items():
        assert document == other[path], path
    assert "KEYED" not in str(one)


def test_where_only_the_direction_is_told_no_document_depends_on_the_key(pair: list[Site]) -> None:
    """Among the answers are the slips that a sentence would name: sign, factor of two, power of ten, reciprocal."""
    typed = ["16 ms", "10 ms", "-5 ms", "-8 ms", "2.5 ms", "5 s", "0.8 ms", "200 ms"]
    one, other = (act(site, "direction", [("number", answer) for answer in typed], []) for site in pair)
    assert one == other
    assert "16 ms is too high." in str(one)
    assert "-5 ms is too low." in str(one)
    assert "KEYED" not in str(one)


def test_once_published_the_two_differ(pair: list[Site]) -> None:
    """The comparison itself can tell right from wrong."""
    seen = []
    for site in pair:
        course = f"course-{secrets.token_hex(6)}"
        ann, tina = site.client("ann", course=course), site.client("tina", "instructor", course)
        made = ann.post(f"{API}/submissions", json={"quiz": "publish", "question": "choice", "answer": 1}).json()
        assert made["verdict"]["status"] == made["status"] == "needs_review"
        assert made["withheld"] == made["verdict"]["diagnosis"]
        tag = ann.get(f"{API}/submissions/{made['id']}").headers["etag"]
        assert tina.put(f"{API}/quizzes/publish/publication").status_code == 204
        again = ann.get(f"{API}/submissions/{made['id']}", headers={"If-None-Match": tag})
        assert again.status_code == 200  # the ETag has changed with what is shown
        assert again.json()["withheld"] is None
        seen.append(again.json()["verdict"]["status"])
        assert tina.delete(f"{API}/quizzes/publish/publication").status_code == 204
        assert ann.get(f"{API}/submissions/{made['id']}").json() == made
    assert seen == ["incorrect", "correct"]
