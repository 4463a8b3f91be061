"""The examples in OpenAPI are what a server answers: every route is called, and its answer compared with the file.

`make examples` writes the file anew.
"""

import json
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
import pytest
from sqlalchemy import event, update

from api.recording import Normaliser, Recorder, as_text
from grader.api import openapi
from grader.courses.people import platforms as rules
from grader.courses.people.identity import COOKIE, DEFAULT_COURSE, Role
from grader.courses.people.members import get_named
from grader.courses.people.sign_in import start_session
from grader.courses.regrading.background import Regrading
from grader.gate.admission import PREFIX as API
from grader.grading.pipeline import Retries
from grader.grading.processes import Graders
from grader.queue import jobs
from grader.queue.worker import Worker
from grader.service.worker import make_judge
from grader.settings import Settings
from grader.store import platforms
from grader.store.outbox import Delivery, Destination
from grader.store.tables import now
from platforms.joined import Joined, joined_in
from platforms.platform import LEARNER, NRPS
from support.sites import ROOT, open_site, write_content

pytestmark = pytest.mark.slow

DUE = "2099-10-19T09:30:00Z"
HOMEWORK = {
    "id": "homework",
    "title": "Homework",
    "policy": {"due": DUE},
    "questions": [{"kind": "numeric", "q": "How long is the step?", "answer": 5, "tol": 0.0625, "unit": "ms"}],
}
ESSAY = {
    "id": "essay",
    "title": "Essay",
    "second_marking": {"share": 1, "tolerance": 0.5},
    "questions": [
        {
            "kind": "open",
            "id": "why",
            "q": "Why?",
            "points": 3,
            "reference": "The damping is implicit.",
            "rubric": [{"id": "damping", "title": "Names the damping", "points": 3, "group": "Physics"}],
        }
    ],
}
SCRIPT = {"quiz": "1.3-exercises", "question": "rk4-step", "answer": {"source": "def rk4_step(model, data): ..."}}
NUMBER = {"quiz": "small", "question": "q2", "answer": "5 s"}
LEARNER_AT_SCHOOL = {"namespace": "school", "id": "s1815", "name": "Ada Lovelace"}
ROSTER = "name,email,role,namespace,external_id\r\nMary,mary@school.example,student,school,s1797\r\n"
MOODLE = {
    "name": "Moodle",
    "issuer": "https://moodle.example.org",
    "client_id": "7QeqkUdFHNNvY3P",
    "login_url": "https://moodle.example.org/mod/lti/auth.php",
    "token_url": "https://moodle.example.org/mod/lti/token.php",
    "keys_url": "https://moodle.example.org/mod/lti/certs.php",
    "deployment_id": "1",
}


@dataclass
class Scene:
    """A server with a learning platform, some people, and the recorder of what they are answered."""

    joined: Joined
    recorder: Recorder

    def __post_init__(self) -> None:
        site = self.joined.site
        self.tina, self.tom = site.client("tina", "instructor"), site.client("tom", "instructor")
        self.ada, self.bob = site.client("ada"), site.client("bob")
        self.lms = site.client("lms", "service")

    def record(self, client: httpx.Client, route: str, status: int = 200, **request: Any) -> Any:
        """Records an answer. Returns its JSON, or its text."""
        response = self.recorder.record(status, client, route, **request)
        is_json = response.headers.get("content-type", "").startswith("application/json")
        return response.json() if is_json else response.text

    def regrade(self) -> None:
        """Does the jobs of regrades."""
        services, retries = self.joined.site.app.state.services, Retries(1)
        judge = make_judge(services.content.archive, Graders(0, allow_t2=False))
        regrading = Regrading(services.database, services.content.archive, judge, retries)
        worker = Worker(services.database, {jobs.REGRADE: regrading}, 1, retries)
        while worker.do_one():
            pass


def test_every_example_is_what_a_server_answers(request: pytest.FixtureRequest, tmp_path: Path) -> None:
    with joined_in(tmp_path) as joined:
        write_quizzes(joined)
        origins = {joined.site.origin: "https://grader.example.org", joined.platform.origin: "https://lms.example.org"}
        scene = Scene(joined, Recorder(Normaliser(origins, (DUE,))))
        record_answers(scene)
        record_reviews(scene)
        record_people(scene)
        record_webhooks(scene)
        record_results(scene)
        record_regrades(scene)
        record_platforms(scene)
        record_health(scene, tmp_path)
        record_problems(scene)
    recorded = scene.recorder.document()
    if request.config.getoption("--record-examples"):
        openapi.EXAMPLES.write_text(as_text(recorded), encoding="utf-8")
    shipped = json.loads(openapi.EXAMPLES.read_text(encoding="utf-8"))
    assert recorded["problems"] == shipped["problems"]
    assert recorded["responses"].keys() == shipped["responses"].keys()
    for route, by_status in recorded["responses"].items():
        assert by_status == shipped["responses"][route], f"{route}: `make examples` records it anew"


def write_quizzes(joined: Joined) -> None:
    """Adds homework, an essay and the lesson's exercises to the content of a server."""
    content = joined.site.settings.content
    for quiz in (HOMEWORK, ESSAY):
        (content / "quizzes" / f"{quiz['id']}.json").write_text(json.dumps(quiz))
    shutil.copy(ROOT / "quizzes" / "1.3-exercises.json", content / "quizzes")
    shutil.copytree(ROOT / "quizzes" / "starters", content / "quizzes" / "starters")
    joined.site.client("tina", "instructor").post(f"{API}/content:reload").raise_for_status()


def record_answers(scene: Scene) -> None:
    """What learners do, and systems on their behalf."""
    ada = scene.ada
    scene.record(ada, "GET /quizzes")
    scene.record(ada, "POST /answers:validate", json=NUMBER)
    answered = scene.record(ada, "POST /submissions", 201, json=NUMBER)
    scene.record(ada, "GET /quizzes/{quiz_id}", quiz_id="small")
    exercise: dict[str, Any] = {"quiz_id": "1.3-exercises", "question_id": "servo-threshold"}
    scene.record(ada, "GET /quizzes/{quiz_id}/questions/{question_id}/kit", **exercise)
    queued = scene.record(ada, "POST /submissions", 202, json=SCRIPT)
    scene.record(ada, "GET /submissions/{submission_id}", submission_id=answered["id"])
    scene.record(ada, "GET /submissions/{submission_id}/films", submission_id=answered["id"])
    scene.record(ada, "POST /submissions/{submission_id}:stop", submission_id=queued["id"])
    scene.record(ada, "GET /submissions/{submission_id}/events", submission_id=queued["id"])
    line = {"line": 1, "text": "Which criterion is this?"}
    route = "/submissions/{submission_id}/comments"
    scene.record(scene.tina, f"POST {route}", 201, submission_id=queued["id"], json=line)
    scene.record(ada, f"GET {route}", submission_id=queued["id"])
    ada.post(f"{API}/submissions", json={"quiz": "small", "question": "q3", "answer": 1}).raise_for_status()
    scene.record(ada, "GET /submissions", params={"limit": 1})
    lab = {"quiz": "small", "question": "q3", "controls": {"step": 0.01}, "seconds": 0.02}
    scene.record(ada, "POST /labs:run", json=lab)
    named = {"learner": LEARNER_AT_SCHOOL}
    scene.record(scene.lms, "POST /lms/quizzes/{quiz_id}:show", quiz_id="homework", json=named)
    theirs = scene.record(scene.lms, "POST /lms/submissions", 201, json={**NUMBER, "learner": LEARNER_AT_SCHOOL})
    scene.record(scene.lms, "POST /lms/submissions", 202, json={**SCRIPT, "learner": LEARNER_AT_SCHOOL})
    scene.record(scene.lms, "GET /lms/submissions/{submission_id}", submission_id=theirs["id"])


def record_reviews(scene: Scene) -> None:
    """Two reviewers, who disagree."""
    tina, tom, place = scene.tina, scene.tom, {"quiz": "essay", "question": "why"}
    scene.bob.post(f"{API}/submissions", json={**place, "answer": "because"}).raise_for_status()
    comment = scene.record(tina, "POST /reviews/comments", 201, json={**place, "text": "Name it."})
    route = "PUT /reviews/comments/{comment_id}"
    scene.record(tina, route, comment_id=comment["id"], json={"text": "Name the damping."})
    scene.record(tina, "GET /reviews/comments", params=place)
    submission = {"submission_id": scene.record(tina, "POST /reviews:claim", json={"quiz": "essay"})["id"]}
    scene.record(tina, "POST /reviews:heartbeat", json=submission)
    scene.record(tina, "GET /reviews")
    seen = tina.get(f"{API}/submissions/{submission['submission_id']}/review")
    scene.record(tina, "GET /submissions/{submission_id}/review", **submission)
    first: dict[str, Any] = {
        "headers": {"If-Match": seen.headers["etag"]},
        "json": {"rubric": ["damping"], "comment": "Well put."},
    }
    scene.record(tina, "PUT /submissions/{submission_id}/review", **submission, **first)
    tom.post(f"{API}/reviews:claim", json={**submission, "second": True}).raise_for_status()
    second: dict[str, Any] = {"headers": {"If-Match": "*"}, "json": {"points": 1.0, "comment": "No reason given."}}
    scene.record(tom, "PUT /submissions/{submission_id}/review/second", **submission, **second)
    scene.record(tina, "GET /reviews/disagreements")
    scene.record(tina, "POST /reviews:recompute", json=place)
    scene.record(tom, "DELETE /submissions/{submission_id}/review", **submission, headers={"If-Match": "*"})
    scene.recorder.record(428, tina, "PUT /submissions/{submission_id}/review", **submission, json={"points": 1.0})
    stale: dict[str, Any] = {"headers": {"If-Match": '"stale"'}, "json": {"points": 1.0}}
    scene.recorder.record(412, tina, "PUT /submissions/{submission_id}/review", **submission, **stale)


def record_people(scene: Scene) -> None:
    """Members, and the ways into the course."""
    tina = scene.tina
    csv: dict[str, Any] = {"content": ROSTER.encode(), "headers": {"Content-Type": "text/csv"}}
    scene.record(tina, "POST /roster:import", **csv)
    members = scene.record(tina, "GET /members")["items"]
    mary = next(member["id"] for member in members if member["name"] == "Mary")
    scene.record(tina, "PATCH /members/{member_id}", member_id=mary, json={"role": "instructor"})
    scene.record(tina, "PATCH /members/{member_id}", member_id=mary, json={"role": "student"})
    scene.record(tina, "POST /invitations", 201, json={"names": ["Grace Hopper"]})
    scene.record(tina, "GET /invitations")
    scene.record(tina, "POST /courses", 201, json={"name": "robots"})
    scene.record(tina, "GET /courses")
    scene.record(tina, "POST /tokens", 201, json={"user": "lti", "role": "service", "scopes": ["results"], "days": 30})
    scene.record(tina, "GET /tokens")
    device = scene.joined.site.anonymous()
    codes = scene.record(device, "POST /devices", json={"client_name": "Jupyter on my laptop"})
    secret = {"device_code": codes["device_code"]}
    scene.record(device, "POST /devices:token", 400, json=secret)
    with scene.joined.site.app.state.services.database.write() as session:
        opened = start_session(session, get_named(session, "ada", Role.STUDENT))
    cookie = {"Cookie": f"{COOKIE}={opened.secret}", "Sec-Fetch-Site": "same-origin"}
    allowed = {"code": codes["user_code"], "decision": "allow"}
    assert scene.joined.site.anonymous(cookie).post("/devices", data=allowed).status_code == 303
    scene.record(device, "POST /devices:token", json=secret)
    scene.record(tina, "PUT /course/link")
    scene.record(tina, "GET /course")
    scene.record(tina, "GET /roster.csv")
    scene.record(tina, "GET /roster.zip")
    extension = {"user": "ada", "due": DUE, "attempts": 1}
    scene.record(tina, "PUT /quizzes/{quiz_id}/extensions", quiz_id="homework", json=extension)
    scene.record(tina, "GET /quizzes/{quiz_id}/extensions", quiz_id="homework")
    scene.record(tina, "GET /me")
    scene.record(tina, "GET /audit")
    rules = {"due": "2099-10-26T09:30:00Z", "attempts": 3}
    any_version = {"If-Match": "*"}
    scene.record(tina, "PUT /quizzes/{quiz_id}/policy", quiz_id="homework", json=rules, headers=any_version)
    scene.record(tina, "GET /quizzes/{quiz_id}/policy", quiz_id="homework")


def record_webhooks(scene: Scene) -> None:
    """A webhook, and deliveries that failed."""
    lms = scene.lms
    made = scene.record(lms, "POST /webhooks", 201, json={"url": "https://moodle.example.org/hooks/grader"})
    webhook = {"webhook_id": made["id"]}
    scene.record(lms, "GET /webhooks/{webhook_id}", **webhook)
    scene.record(lms, "GET /webhooks")
    scene.record(lms, "POST /webhooks/{webhook_id}:rotate", **webhook)
    answer = {"quiz": "homework", "question": "q1", "answer": "5 ms"}
    scene.ada.post(f"{API}/submissions", json=answer).raise_for_status()
    fail_deliveries(scene)
    (delivery,) = scene.record(lms, "GET /deliveries")["items"]
    scene.record(lms, "POST /deliveries/{delivery_id}:replay", delivery_id=delivery["id"])
    fail_deliveries(scene)
    scene.record(lms, "POST /webhooks/{webhook_id}:replay", **webhook)
    with scene.joined.database.write() as session:
        session.execute(update(Destination).values(disabled_at=now(), why_disabled="The receiver answered 410."))
    scene.record(lms, "POST /webhooks/{webhook_id}:enable", **webhook)


def fail_deliveries(scene: Scene) -> None:
    """Makes every delivery a dead letter, as its last try does."""
    dead = {"state": "dead", "attempts": 9, "error": "The receiver answered 500.", "next_at": None}
    with scene.joined.database.write() as session:
        session.execute(update(Delivery).values(dead))


def record_results(scene: Scene) -> None:
    """Points, and what they tell."""
    scene.record(scene.lms, "GET /results", params={"limit": 1})
    scene.record(scene.tina, "GET /gradebook.csv", params={"quiz": "small"})
    scene.record(scene.tina, "GET /quizzes/{quiz_id}/statistics", quiz_id="small")
    scene.record(scene.tina, "POST /quizzes/{quiz_id}/results:recount", quiz_id="small")


def record_regrades(scene: Scene) -> None:
    """A wrong key is corrected."""
    tina, content = scene.tina, scene.joined.site.settings.content
    questions = [{**HOMEWORK["questions"][0], "answer": 4}]  # type: ignore[index]
    (content / "quizzes" / "homework.json").write_text(json.dumps({**HOMEWORK, "questions": questions}))
    scene.record(tina, "POST /content:reload")
    body = {"quiz": "homework", "question": "q1", "scope": "best"}
    started = scene.record(tina, "POST /regrades", 202, json=body)
    scene.regrade()
    scene.record(tina, "GET /regrades/{regrade_id}", regrade_id=started["id"])
    scene.record(tina, "GET /regrades")
    other = tina.post(f"{API}/regrades", json=body).raise_for_status().json()
    scene.record(tina, "POST /regrades/{regrade_id}:cancel", regrade_id=other["id"])


def record_platforms(scene: Scene) -> None:
    """A learning platform, whose course is linked with ours."""
    joined, tina = scene.joined, scene.tina
    added = scene.record(tina, "POST /lti/platforms", 201, json=MOODLE)
    scene.record(tina, "POST /lti/platforms/{platform_id}:approve", platform_id=added["id"])
    scene.record(tina, "GET /lti/platforms")
    scene.record(tina, "POST /lti/registrations", 201)
    with joined.database.write() as session:
        [row] = platforms.find_registered(session, joined.platform.origin, joined.platform.client_id)
        context = platforms.get_context(session, row.id, joined.platform.deployment_id, "context-1", "Robotics")
        session.flush()
        rules.link(session, None, context.id, DEFAULT_COURSE)
        context_id = context.id
    joined.platform.roster = [{"user_id": "user-7", "name": "Lise Meitner", "roles": [LEARNER], "status": "Active"}]
    names = {"context_memberships_url": f"{joined.platform.origin}/roster/0", "service_versions": ["2.0"]}
    joined.launch(joined.browser(), **{NRPS: names})
    scene.record(tina, "GET /lti/contexts")
    scene.record(tina, "POST /lti/contexts/{context_id}:roster", context_id=context_id)


def record_health(scene: Scene, folder: Path) -> None:
    """A server without a worker, and one with a worker."""
    anyone = scene.joined.browser()
    scene.record(anyone, "GET /healthz")
    scene.record(anyone, "GET /metrics")
    scene.recorder.record(503, anyone, "GET /readyz")
    settings = Settings(content=write_content(folder / "ready"), data=folder / "ready-data", workers=1)
    with open_site(settings) as site:
        scene.record(site.anonymous(), "GET /readyz")


def record_problems(scene: Scene) -> None:
    """A refusal of every kind."""
    site, ada, refuse = scene.joined.site, scene.ada, scene.recorder.record
    refuse(401, site.anonymous(), "GET /quizzes")
    refuse(403, ada, "GET /members")
    refuse(404, ada, "GET /submissions/{submission_id}", submission_id="0" * 32)
    ada.post(f"{API}/submissions", json=NUMBER).raise_for_status()
    refuse(409, ada, "POST /submissions", json=NUMBER)
    refuse(413, ada, "POST /submissions", json={**NUMBER, "answer": "x" * (3 << 20)})
    refuse(422, ada, "POST /submissions", json={"question": "q2", "answer": "5 s"})
    with full_disk(scene):
        essay = {"quiz": "essay", "question": "why", "answer": "because " * 1000}
        while ada.post(f"{API}/submissions", json=essay).status_code == 201:
            pass  # into the pages that are free within the file
        refuse(503, ada, "POST /submissions", json=essay)
    ada_id = ada.get(f"{API}/submissions").raise_for_status().json()["items"][0]["learner"]
    site.app.state.services.admission.by_user.charge(ada_id, 1e6)
    refuse(429, ada, "GET /quizzes")


@contextmanager
def full_disk(scene: Scene) -> Iterator[None]:
    """Lets the SQLite file grow no more, which SQLite reports as it does a full disk."""
    engine = scene.joined.database.engine

    def limit(connection: Any, _record: Any) -> None:
        connection.execute("PRAGMA max_page_count = 1")  # means: as many as the file has

    event.listen(engine, "connect", limit)
    engine.dispose()  # the limit is each connection's own
    yield
    event.remove(engine, "connect", limit)
    engine.dispose()
