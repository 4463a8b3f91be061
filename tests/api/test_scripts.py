"""Scripts over HTTP: queued, run in the real jail, graded, with events on the way."""

import secrets
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

import httpx
import pytest
from sqlalchemy import delete, select

from grader.api.learning import events
from grader.courses.people.identity import read_identity
from grader.domain.progress import ignore_progress
from grader.domain.verdict import Status, Verdict
from grader.errors import JailFault
from grader.exercises import Tell
from grader.gate.streams import STREAMS_MAX
from grader.grading.pipeline import Retries
from grader.grading.processes import Graders, ScriptJob
from grader.library import Library
from grader.queue import jobs
from grader.queue.jobs import JobRow
from grader.queue.worker import Worker
from grader.service.accounts import revoke_tokens
from grader.service.worker import GradingTask, Judge, make_fault, make_grade
from grader.settings import Settings
from grader.store import submissions
from grader.store.events import add_event
from grader.store.tables import Credential, Submission
from support.sites import ROOT, Site, open_site

pytestmark = pytest.mark.slow

API = "/api/v1"
LESSON = Settings().content
REFERENCE = ROOT / "reference_solutions" / "1.3-exercises" / "servo-threshold" / "correct__spectral_radius.py"
GOOD = Verdict(status=Status.CORRECT, points=1.0, max_points=1.0)


def read_events(client: httpx.Client, location: str, **headers: str) -> list[dict[str, str]]:
    """Listens to the end."""
    with client.stream("GET", f"{location}/events", headers=headers) as response:
        if response.status_code == 204:
            return []
        assert response.headers["content-type"].startswith("text/event-stream")
        lines = [line for line in response.iter_lines() if not line.startswith(":")]
    blocks = [block.splitlines() for block in "\n".join(lines).split("\n\n") if block.strip()]
    return [dict(line.split(": ", 1) for line in block) for block in blocks]


def hand_in(client: httpx.Client, source: Any, **headers: str) -> httpx.Response:
    answer = {"source": source} if isinstance(source, str) else source
    body = {"quiz": "1.3-exercises", "question": "servo-threshold", "answer": answer}
    return client.post(f"{API}/submissions", json=body, headers=headers)


def a_worker(site: Site, grade: Judge) -> Worker:
    """A worker in this process, without threads: `do_one` does its work."""
    services = site.app.state.services
    tasks = {jobs.GRADE: GradingTask(grade, make_fault(services.content.archive))}
    return Worker(services.database, tasks, 1, Retries(3, pause_s=0.0))


@pytest.fixture(scope="module")
def graded(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    """A server with the shipped content, a worker and its jail."""
    with open_site(Settings(data=tmp_path_factory.mktemp("graded"), workers=1)) as site:
        yield site


@pytest.fixture(scope="module")
def shared_idle(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    with open_site(Settings(data=tmp_path_factory.mktemp("idle"), workers=0)) as site:
        yield site


@pytest.fixture
def idle(shared_idle: Site) -> Iterator[Site]:
    """The same without a worker: submissions stay queued. Each test is a course of its own, and leaves no jobs."""
    yield replace(shared_idle, course=f"course-{secrets.token_hex(4)}")
    with shared_idle.app.state.services.database.write() as session:
        session.execute(delete(JobRow))


def test_a_script_is_accepted_run_and_judged(graded: Site) -> None:
    ann = graded.client("ann")
    made = hand_in(ann, REFERENCE.read_text())
    assert made.status_code == 202
    assert {"status": "queued", "verdict": None, "attempt": 1}.items() <= made.json().items()
    events = read_events(ann, made.headers["location"])
    heard = [event["event"] for event in events]
    assert [name for name in heard if name != "progress"] == ["queued", "running", "graded"]
    shown = ann.get(made.headers["location"])
    assert shown.headers["etag"] != made.headers["etag"]
    body = shown.json()
    assert (body["status"], body["verdict"]["status"]) == ("graded", "correct")
    assert len(body["verdict"]["content_digest"]) == 64
    assert body["answer"] == {"source": REFERENCE.read_text()}


def test_a_script_that_breaks_is_the_learners_and_its_output_comes_back(graded: Site) -> None:
    ann = graded.client("ann")
    made = hand_in(ann, "print('hello')\nraise SystemExit(3)\n")
    last = read_events(ann, made.headers["location"])[-1]
    assert last["event"] == "graded"
    verdict = ann.get(made.headers["location"]).json()["verdict"]
    assert verdict["status"] == "crashed"
    assert "hello" in verdict["stdout"]


def test_the_jail_is_part_of_readiness(graded: Site) -> None:
    jail = graded.anonymous().get("/readyz").json()["checks"]["jail"]
    assert jail["ok"]
    assert jail["tier"] in ("T0", "T1")
    assert "attacks held" in jail["self_test"]


def test_a_late_listener_gets_the_events_it_missed_and_204_after_the_last(graded: Site) -> None:
    ann = graded.client("ann")
    made = hand_in(ann, "x = 1\n")
    all_of_them = read_events(ann, made.headers["location"])
    assert read_events(ann, made.headers["location"]) == all_of_them
    first, *rest = all_of_them
    assert read_events(ann, made.headers["location"], **{"Last-Event-ID": first["id"]}) == rest
    assert read_events(ann, made.headers["location"], **{"Last-Event-ID": rest[-1]["id"]}) == []
    assert read_events(ann, made.headers["location"], **{"Last-Event-ID": "nonsense"}) == all_of_them


def test_an_instant_answer_has_its_last_event_too(graded: Site) -> None:
    ann = graded.client("ann")
    for question, answer, name in (("q1", 1, "graded"), ("q4", "I would measure.", "needs_review")):
        body = {"quiz": "1.3-check", "question": question, "answer": answer}
        made = ann.post(f"{API}/submissions", json=body)
        assert [event["event"] for event in read_events(ann, made.headers["location"])] == [name]


ALL = ("queued", "running", "graded")


@pytest.mark.parametrize(("last", "to_come"), [("0", ALL), ("1", ALL[1:]), ("99", ALL[1:])])
def test_events_come_while_the_work_goes_on(idle: Site, last: str, to_come: tuple[str, ...]) -> None:
    """A `Last-Event-ID` beyond the last event counts as the last event."""
    ann = idle.client("ann")
    events = f"{hand_in(ann, 'x = 1').headers['location']}/events"
    with ann.stream("GET", events, headers={"Last-Event-ID": last}) as stream:
        a_worker(idle, lambda _: GOOD).do_one()
        heard = [line.removeprefix("event: ") for line in stream.iter_lines() if line.startswith("event: ")]
    assert tuple(heard) == to_come


def test_a_verdict_that_is_committed_while_events_are_read_is_told_with_its_submission(idle: Site) -> None:
    """On PostgreSQL the second of two queries sees what was committed after the first."""
    services = idle.app.state.services
    submission_id = hand_in(idle.client("ann"), "x = 1").json()["id"]
    with services.database.write() as session:
        submission = session.get_one(Submission, submission_id)
        token = session.scalars(select(Credential).where(Credential.member == submission.learner)).one()
        who = read_identity(token)
        add_event(session, submission_id, submissions.GRADED)
    told, over = events.read_events(events.Listener(services, who, submission_id, 0), 0)
    assert ([event.event for event in told], over) == ([submissions.QUEUED], False)


def test_a_stream_ends_with_the_token_that_opened_it(idle: Site) -> None:
    ann = idle.client("ann", course="left")
    events = f"{hand_in(ann, 'x = 1').headers['location']}/events"
    with ann.stream("GET", events) as stream:
        lines = stream.iter_lines()
        assert "event: queued" in lines  # reads up to there
        assert revoke_tokens(idle.settings, "ann", "left") == 1
        a_worker(idle, lambda _: GOOD).do_one()
        assert "verdict" not in "\n".join(lines)


def test_the_oldest_of_too_many_streams_ends(idle: Site) -> None:
    """A thousand streams of one learner made another wait two seconds when the script was graded."""
    ann, bob = idle.client("ann", course="crowd"), idle.client("bob", course="crowd")
    mine, theirs = (f"{hand_in(one, 'x = 1').headers['location']}/events" for one in (ann, bob))
    with ExitStack() as stack:

        def opened(client: httpx.Client, events: str) -> Iterator[str]:
            lines: Iterator[str] = stack.enter_context(client.stream("GET", events)).iter_lines()
            assert "event: queued" in lines  # reads up to there
            return lines

        other = opened(bob, theirs)
        first, second, *_ = [opened(ann, mine) for _ in range(STREAMS_MAX + 1)]
        assert "event: graded" not in list(first)  # ends before the script is graded
        worker = a_worker(idle, lambda _: GOOD)
        while worker.do_one():
            pass
        assert "event: graded" in list(second)
        assert "event: graded" in list(other)


def test_nobody_else_may_listen(graded: Site) -> None:
    made = hand_in(graded.client("ann"), "x = 1\n")
    assert graded.client("bob").get(f"{made.headers['location']}/events").status_code == 404
    assert graded.client("tina", "instructor").get(made.headers["location"]).status_code == 200


def test_a_submission_and_its_job_are_kept_together_or_not_at_all(idle: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object, **_named: object) -> None:
        raise RuntimeError

    ann = idle.client("ann")
    monkeypatch.setattr("grader.courses.answering.intake.jobs.put", broken)
    assert hand_in(ann, "x = 1\n", **{"Idempotency-Key": "k"}).status_code == 500
    assert ann.get(f"{API}/submissions").json()["items"] == []
    monkeypatch.undo()
    assert hand_in(ann, "x = 1\n", **{"Idempotency-Key": "k"}).status_code == 202
    with idle.app.state.services.database.read() as session:
        assert jobs.count_jobs(session) == 1


def test_a_repeated_script_is_not_queued_twice(idle: Site) -> None:
    ann = idle.client("ann")
    first, again = (hand_in(ann, "x = 1\n", **{"Idempotency-Key": "k"}) for _ in range(2))
    assert (again.status_code, again.json()) == (202, first.json())
    with idle.app.state.services.database.read() as session:
        assert jobs.count_jobs(session) == 1


@pytest.mark.parametrize(
    ("answer", "status"),
    [
        ("#" * (256 * 1024 + 1), 413),
        ("#" * (256 * 1024), 202),
        ("é" * (128 * 1024 + 1), 413),
        ({"source": "x", "more": 1}, 422),
        ({"source": 5}, 422),
        (5, 422),
        ([], 422),
    ],
    ids=["too-long", "longest", "too-many-bytes", "unknown-key", "number", "no-object", "list"],
)
def test_sources_that_cannot_be_taken_are_refused_before_they_are_queued(idle: Site, answer: Any, status: int) -> None:
    ann = idle.client("ann")
    assert hand_in(ann, answer).status_code == status
    assert len(ann.get(f"{API}/submissions").json()["items"]) == (status == 202)


def test_an_empty_script_is_invalid_at_once(idle: Site) -> None:
    made = hand_in(idle.client("ann"), "  \n")
    assert (made.status_code, made.json()["verdict"]["status"]) == (201, "invalid_answer")


def test_one_learner_cannot_fill_the_queue(open_site_with: Callable[..., Site]) -> None:
    site = open_site_with(content=LESSON, queue_per_user=2)
    ann = site.client("ann")
    assert [hand_in(ann, "x = 1\n").status_code for _ in range(3)] == [202, 202, 429]
    assert hand_in(site.client("bob"), "x = 1\n").status_code == 202
    assert len(ann.get(f"{API}/submissions").json()["items"]) == 2


def test_logs_hold_neither_sources_nor_tokens(
    capsys: pytest.CaptureFixture[str], idle: Site, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object, **_named: object) -> None:
        raise RuntimeError("broken")

    monkeypatch.setattr("grader.courses.answering.intake.jobs.put", broken)
    ann = idle.client("ann")
    hand_in(ann, "source_that_nobody_may_log = 1\n")
    log = "".join(capsys.readouterr())
    assert "RuntimeError: broken" in log
    assert "source_that_nobody_may_log" not in log
    assert ann.headers["Authorization"].split("_")[2] not in log


def test_the_database_is_where_the_settings_say(idle: Site) -> None:
    assert idle.app.state.services.database.engine.url.database == str(idle.settings.data / "grader.db")


def test_a_grader_fault_has_0_points_of_the_questions_points(idle: Site) -> None:
    content = idle.app.state.services.content
    library = content.get("default").library
    fault, digest = make_fault(content.archive), library.digest("1.3-exercises")
    submission = Submission(
        quiz="1.3-exercises", question="rk4-free-joint", answer='{"source": "x = 1"}', content_digest=digest
    )
    verdict = fault(submission)
    assert (verdict.status, verdict.points) == (Status.GRADER_FAULT, 0.0)
    assert verdict.environment["mujoco"]
    assert len(verdict.submission_digest) == len(verdict.content_digest) == 64
    assert verdict.max_points == library.question("1.3-exercises", "rk4-free-joint").points > 0
    submission.question = "gone"
    assert fault(submission).max_points == 0
    submission.question, submission.content_digest = "rk4-free-joint", "f" * 64
    assert fault(submission).max_points == 0


def test_the_seed_of_hidden_cases_is_for_instructors_only(idle: Site) -> None:
    ann, tina = idle.client("ann"), idle.client("tina", "instructor")
    made = hand_in(ann, "x = 1\n")
    submission_id = made.json()["id"]
    with idle.app.state.services.database.read() as session:
        seed = session.get_one(Submission, submission_id).seed
    a_worker(idle, lambda _: GOOD).do_one()
    location = made.headers["location"]
    to_learner = [
        made.text,
        ann.get(location).text,
        ann.get(f"{API}/submissions").text,
        *map(str, read_events(ann, location)),
    ]
    assert not [text for text in to_learner if str(seed) in text]
    assert ann.get(location).json()["seed"] is None
    assert tina.get(location).json()["seed"] == seed
    assert tina.get(f"{API}/submissions").json()["items"][0]["seed"] == seed


def test_an_installation_keeps_its_secret_and_two_installations_differ(
    open_site_with: Callable[..., Site], tmp_path: Path
) -> None:
    first, again = open_site_with(content=LESSON), open_site_with(content=LESSON)
    other = open_site_with(content=LESSON, data=tmp_path / "elsewhere")
    seeds = [
        site.app.state.services.content.get("default")
        .pipeline.read("1.3-exercises", "rk4-step", {"source": "x = 1"})
        .seed
        for site in (first, again, other)
    ]
    assert seeds[0] == seeds[1] != seeds[2]


class RecordingGraders(Graders):
    """Stands in for the processes: records what it is asked to judge."""

    def __init__(self, fault: JailFault | None = None) -> None:
        super().__init__(0, allow_t2=False)
        self.scripts: list[ScriptJob] = []
        self.fault = fault

    def judge(self, _library: Library, script: ScriptJob, tell: Tell = ignore_progress) -> Verdict:
        self.scripts.append(script)
        if self.fault is not None:
            raise self.fault
        return GOOD


def test_a_recorded_seed_is_the_one_that_a_worker_grades_with(idle: Site) -> None:
    graders = RecordingGraders()
    hand_in(idle.client("ann"), "x = 1\n")
    with idle.app.state.services.database.write() as session:
        session.query(Submission).update({"seed": 12})
    a_worker(idle, make_grade(idle.app.state.services.content.archive, graders)).do_one()
    assert [script.seed for script in graders.scripts] == [12]


def test_only_the_queue_tries_again_while_the_jail_is_broken(idle: Site) -> None:
    graders = RecordingGraders(JailFault("broken"))
    ann = idle.client("ann")
    made = hand_in(ann, "x = 1\n")
    worker = a_worker(idle, make_grade(idle.app.state.services.content.archive, graders))
    while worker.do_one():
        pass
    assert [script.answer for script in graders.scripts] == [{"source": "x = 1\n"}] * 3
    assert ann.get(made.headers["location"]).json()["verdict"]["status"] == "grader_fault"
    assert hand_in(ann, "x = 2\n").json()["attempt"] == 1
