"""Regrades: who is affected and how, in the background, once, and never against a person's decision."""

import json
import secrets
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    precondition,
    rule,
    run_state_machine_as_test,
)
from sqlalchemy import delete, select

from grader.courses.answering import results as counting
from grader.courses.people.identity import Identity, Role
from grader.courses.regrading import background, regrades
from grader.courses.regrading.background import Regrading
from grader.courses.regrading.regrades import RegradeRequest, Scope
from grader.courses.rules.policy import count_points
from grader.domain.policy import Extension
from grader.domain.verdict import Status, Verdict, apply_review
from grader.errors import Conflict, ContentLost, JailFault, NotFound
from grader.grading.content import Archive, Content
from grader.grading.pipeline import Pipeline, Retries
from grader.grading.processes import Graders
from grader.questions import Question
from grader.questions.parts import by_id
from grader.queue import jobs
from grader.queue.worker import Worker
from grader.service.worker import make_judge
from grader.store import extensions, results, submissions
from grader.store import regrades as stored
from grader.store.contents import EVERY, ContentFile
from grader.store.engine.database import Database
from grader.store.engine.ids import make_id
from grader.store.events import EVENTS, events_after
from grader.store.results import LearnerAt
from grader.store.tables import ResultRevision, Submission, VerdictRow
from support.databases import BACKENDS, database_url, open_database

pytestmark = pytest.mark.slow

DUE = datetime(2026, 3, 10, 18, tzinfo=UTC)
LATE = {"per_day": 0.5, "until": "2199-12-31T00:00:00Z"}
LATE_POLICY = {"due": DUE.isoformat(), "late": LATE}


def a_quiz(
    key: int = 5, policy: dict[str, Any] | None = None, number: str = "numeric", asked: dict[str, Any] | None = None
) -> dict[str, Any]:
    """A number whose key is `key`, or a choice in its place, and a text."""
    asked = {"id": "number", "q": "How many?", "points": 2} | (asked or (
        {"kind": "numeric", "answer": key} if number == "numeric"
        else {"kind": "mcq", "options": ["a", "b"], "answer": 0}
    ))  # fmt: skip
    questions = [asked, {"kind": "open", "id": "text", "q": "Why?"}]
    return {"id": "quiz", "title": "Quiz", "policy": policy or {}, "questions": questions}


@dataclass
class Course:
    """A course on one database, and what happens in it. Its worker has no threads: `work` does the jobs."""

    database: Database
    root: Path
    content: Content = field(init=False)
    name: str = field(default_factory=lambda: f"course-{secrets.token_hex(6)}")

    def __post_init__(self) -> None:
        self.write()
        self.content = Content(EVERY, self.root, Archive(self.database))
        self.tina = Identity("tina", "Tina", Role.INSTRUCTOR, self.name)
        judge = make_judge(self.content.archive, Graders(0, allow_t2=False))
        self.regrading = Regrading(self.database, self.content.archive, judge, Retries(3, pause_s=0.0))

    def write(self, **changes: Any) -> None:
        (self.root / "quizzes").mkdir(parents=True, exist_ok=True)
        (self.root / "quizzes" / "quiz.json").write_text(json.dumps(a_quiz(**changes)))

    def change(self, **changes: Any) -> None:
        self.write(**changes)
        self.content.reload()

    def worker(self, task: Regrading | None = None, tries: int = 3) -> Worker:
        retries = Retries(tries, pause_s=0.0)
        return Worker(self.database, {jobs.REGRADE: task or self.regrading}, threads=2, retries=retries)

    def work(self, task: Regrading | None = None) -> None:
        worker = self.worker(task)
        while worker.do_one():
            pass

    def hand_in(self, learner: str, answer: Any, at: datetime | None = None, question: str = "number") -> str:
        pipeline = self.content.pipeline
        parsed = pipeline.read("quiz", question, answer)
        verdict = pipeline.judge(parsed)
        submission = Submission(
            id=make_id(), course=self.name, learner=learner, user=learner.title(), quiz="quiz", question=question,
            answer=parsed.text, content_digest=pipeline.library.digest("quiz"), attempt=1,
        )  # fmt: skip
        with self.database.write() as session:
            submissions.add(session, [(submission, verdict)])
            if at is not None:
                session.get_one(Submission, submission.id).created_at = at
                session.flush()
            counting.recount(session, pipeline.library, LearnerAt.from_submission(submission))
        return submission.id

    def queue(self, learner: str, answer: Any) -> str:
        """As `hand_in`, before the verdict."""
        submission = Submission(
            id=make_id(), course=self.name, learner=learner, user=learner, quiz="quiz", question="number",
            answer=json.dumps(answer), content_digest="old", attempt=1,
        )  # fmt: skip
        with self.database.write() as session:
            submissions.add(session, [(submission, None)])
        return submission.id

    def append(self, submission_id: str, verdict: Verdict, cause: str) -> None:
        with self.database.write() as session:
            submission = session.get_one(Submission, submission_id)
            library = self.content.library
            counting.append_verdict(self.database, library, session, submission, verdict, cause=cause)

    def review(self, submission_id: str, points: float) -> None:
        verdict = Verdict.model_validate(self.newest(submission_id))
        self.append(submission_id, apply_review(verdict, points, "Seen."), "review")

    def start(self, scope: Scope | tuple[str, ...] = "all", dry_run: bool = False, question: str | None = None) -> str:
        return regrades.create(
            self.database, self.content.library, self.tina, RegradeRequest("quiz", question, scope, dry_run)
        ).id

    def regrade(self, scope: Scope | tuple[str, ...] = "all", dry_run: bool = False) -> dict[str, Any]:
        regrade_id = self.start(scope, dry_run)
        self.work()
        return self.shown(regrade_id)

    def shown(self, regrade_id: str, changed: bool = False) -> dict[str, Any]:
        with self.database.read() as session:
            regrade = regrades.get(session, regrade_id, self.name)
            view = regrades.describe_regrade(regrade, stored.count_by_outcome(session, regrade))
            return view | {"items": regrades.read_page(session, regrade, 0, 1000, changed=changed)}

    def verdicts(self, submission_id: str) -> list[tuple[str, str, float]]:
        with self.database.read() as session:
            rows = select(VerdictRow).where(VerdictRow.submission_id == submission_id).order_by(VerdictRow.revision)
            return [(row.cause, row.status, row.points) for row in session.scalars(rows)]

    def said(self, submission_id: str) -> list[tuple[str, dict[str, Any]]]:
        """The cause of each verdict, and what it says."""
        with self.database.read() as session:
            rows = select(VerdictRow).where(VerdictRow.submission_id == submission_id).order_by(VerdictRow.revision)
            stored = [(row.cause, json.loads(row.body)) for row in session.scalars(rows)]
        return [(cause, {key: told[key] for key in told.keys() - background.VOLATILE}) for cause, told in stored]

    def newest(self, submission_id: str) -> dict[str, Any]:
        with self.database.read() as session:
            verdict: dict[str, Any] = submissions.read_verdicts(
                session, submissions.get_several(session, [submission_id])
            )[submission_id]
            return verdict

    def points(self, learner: str, question: str = "number") -> float | None:
        with self.database.read() as session:
            result = results.find(session, LearnerAt(self.name, learner, "quiz", question))
            return None if result is None else result.points

    def feed(self) -> int:
        with self.database.read() as session:
            return len(session.scalars(select(ResultRevision).where(ResultRevision.course == self.name)).all())


@pytest.fixture(scope="module", params=BACKENDS)
def database(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Database]:
    with open_database(request.param, tmp_path_factory.mktemp("data")) as database:
        yield database


@pytest.fixture
def course(database: Database, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Course]:
    monkeypatch.setattr(background, "LOOK_S", 0.0)
    yield Course(database, tmp_path / "content")
    with database.write() as session:  # jobs are shared by all courses of the database
        session.execute(delete(jobs.JobRow))


def outcomes(shown: dict[str, Any]) -> dict[str, int]:
    outcomes: dict[str, int] = shown["progress"]["outcomes"]
    return outcomes


def told(shown: dict[str, Any]) -> dict[str, tuple[float | None, float | None, float | None]]:
    return {item["learner"]: (item["before"], item["after"], item["difference"]) for item in shown["items"]}


def test_a_wrong_key_is_tried_out_then_corrected_and_correcting_again_changes_nothing(course: Course) -> None:
    ann, bob = course.hand_in("ann", 5), course.hand_in("bob", 6)
    course.hand_in("eve", 7)
    course.change(key=6)
    tried = course.regrade(dry_run=True)
    assert (tried["status"], outcomes(tried)) == ("done", {"changed": 3})
    assert told(tried) == {"ann": (2, 0, -2), "bob": (0, 2, 2), "eve": (0, 0, 0)}
    assert course.points("ann") == 2
    assert course.feed() == 3
    assert len(course.verdicts(ann)) == 1
    done = course.regrade()
    assert told(done) == told(tried)
    assert (course.points("ann"), course.points("bob"), course.points("eve")) == (0, 2, 0)
    assert course.verdicts(bob) == [("grading", "incorrect", 0), ("regrade", "correct", 2)]
    assert course.feed() == 5
    again = course.regrade()
    assert outcomes(again) == {"same": 3}
    assert (course.feed(), len(course.verdicts(bob))) == (5, 2)
    item = next(item for item in done["items"] if item["learner"] == "bob")
    assert item["user"] == "Bob"
    assert item["submissions"] == [
        {
            "submission_id": bob,
            "outcome": "changed",
            "old": {"status": "incorrect", "points": 0},
            "new": {"status": "correct", "points": 2},
        }
    ]


def test_listeners_hear_of_a_new_verdict(course: Course) -> None:
    ann = course.hand_in("ann", 5)
    heard: list[None] = []
    with course.database.signals.listening(EVENTS, lambda: heard.append(None), ann):
        course.change(key=6)
        course.regrade()
        deadline = datetime.now(UTC) + timedelta(seconds=30)
        while not heard and datetime.now(UTC) < deadline:
            pass
    assert heard
    with course.database.read() as session:
        assert [event.name for event in events_after(session, ann, 0)] == ["graded", "graded"]


def test_late_multipliers_and_extensions_decide_what_counts_before_and_after(course: Course) -> None:
    course.change(policy=LATE_POLICY)
    with course.database.write() as session:
        extensions.put(session, (course.name, "quiz", "bob"), Extension(due=DUE + timedelta(days=5)), "tina")
    for learner in ("ann", "bob"):
        course.hand_in(learner, 6, DUE - timedelta(hours=1))
        course.hand_in(learner, 5, DUE + timedelta(hours=1))
    assert (course.points("ann"), course.points("bob")) == (1, 2)
    course.change(policy=LATE_POLICY, key=7)
    tried = course.regrade(dry_run=True)
    assert told(tried) == {"ann": (1, 0, -1), "bob": (2, 0, -2)}
    course.change(policy=LATE_POLICY, key=6)
    tried = course.regrade(dry_run=True)
    assert told(tried) == {"ann": (1, 2, 1), "bob": (2, 2, 0)}
    assert told(course.regrade()) == told(tried)
    assert (course.points("ann"), course.points("bob")) == (2, 2)


def test_a_persons_decision_stays(course: Course) -> None:
    ann = course.hand_in("ann", 5)
    text = course.hand_in("ann", "Because.", question="text")
    course.review(ann, 1.5)
    course.change(key=6)
    assert outcomes(course.regrade()) == {"reviewed": 1, "same": 1}
    assert course.points("ann") == 1.5
    course.review(text, 1)
    assert outcomes(course.regrade()) == {"reviewed": 2}
    assert [cause for cause, _, _ in course.verdicts(text)] == ["grading", "review"]


def test_a_review_between_grading_and_storing_is_kept(course: Course) -> None:
    ann = course.hand_in("ann", 5)
    course.change(key=6)
    judge, seen = course.regrading.judge, []

    def reviewed_meanwhile(submission: Submission, digest: str) -> Verdict:
        seen.append(submission.id)
        course.review(ann, 1.5)
        return judge(submission, digest)

    regrade_id = course.start()
    course.work(Regrading(course.database, course.content.archive, reviewed_meanwhile, Retries(3, pause_s=0.0)))
    assert outcomes(course.shown(regrade_id)) == {"reviewed": 1}
    assert (seen, course.points("ann")) == ([ann], 1.5)


def test_a_fault_of_the_grader_is_tried_again_and_never_takes_points(course: Course) -> None:
    ann = course.hand_in("ann", 5)
    bob = course.hand_in("bob", 5)
    course.change(key=6)
    calls: list[str] = []
    judge = course.regrading.judge

    def broken(submission: Submission, digest: str) -> Verdict:
        calls.append(submission.id)
        if submission.id == ann:
            raise JailFault("broken")
        if calls.count(bob) == 1:
            return Verdict(status=Status.GRADER_FAULT, points=0, max_points=2)
        return judge(submission, digest)

    regrade_id = course.start()
    course.work(Regrading(course.database, course.content.archive, broken, Retries(3, pause_s=1e-6)))
    shown = course.shown(regrade_id)
    assert (shown["status"], outcomes(shown)) == ("done", {"changed": 1, "fault": 1})
    assert (calls.count(ann), calls.count(bob)) == (3, 2)
    assert (course.points("ann"), course.points("bob")) == (2, 0)
    assert len(course.verdicts(ann)) == 1


MOVED: dict[str, tuple[dict[str, Any], Any, dict[str, Any]]] = {
    "mcq": (
        {"options": ["Lyon", "Paris", "Nice"], "answer": 1}, 1,
        {"options": ["Paris", "Lyon ", "Nizza"], "answer": 0}),
    "multiple": (
        {"options": ["a", "b", "c"], "answer": [0, 2]}, [0, 2], {"options": ["c", "b", "d", "a"], "answer": [0, 3]}),
    "order": ({"items": ["one", "two", "three"]}, ["one", "two", "three"], {"items": ["one", "two", "three!"]}),
    "match": (
        {"pairs": [["1", "x"], ["2", "y"]]}, {"1": "x", "2": "y"}, {"pairs": [["2", "y"], ["1", "x"]], "extra": ["z"]}),
}  # fmt: skip
"""By kind: a question, its right answer, and another version of it with the same key."""


def answer_by_id(question: Question, answer: Any) -> Any:
    """The answer with the ids of texts in their places, as pages send it."""
    if question.kind == "order":
        ids = {text: item for item, text in by_id(question.items).items()}  # type: ignore[attr-defined]
        return [ids[text] for text in answer]
    if question.kind == "match":
        ids = {text: right for right, text in question.rights.items()}  # type: ignore[attr-defined]
        return {left: ids[right] for left, right in answer.items()}
    return answer


@pytest.mark.parametrize("kind", MOVED)
def test_what_was_chosen_is_found_where_it_stands_now(course: Course, kind: str) -> None:
    first, answer, second = MOVED[kind]
    course.change(asked={"kind": kind, **first})
    submission = course.hand_in("ann", answer_by_id(course.content.library.question("quiz", "number"), answer))
    assert course.points("ann") == 2
    course.change(asked={"kind": kind, **second})
    course.regrade()
    assert course.points("ann") == 2, course.newest(submission)
    course.change(asked={"kind": kind, **first})
    course.regrade()
    assert course.points("ann") == 2


def test_an_option_that_is_gone_or_another_kind_keeps_the_verdict(course: Course) -> None:
    course.change(asked={"kind": "mcq", "options": ["Lyon", "Paris", "Nice"], "answer": 1})
    course.hand_in("ann", 1)
    course.hand_in("ben", 2)
    course.change(asked={"kind": "mcq", "options": ["Paris", "Lyon"], "answer": 1})
    assert outcomes(course.regrade()) == {"changed": 1, "unfit": 1}
    assert (course.points("ann"), course.points("ben")) == (0, 0)
    course.change(asked={"kind": "numeric", "answer": 1})
    assert outcomes(course.regrade()) == {"unfit": 2}


def test_an_answer_for_other_drawn_numbers_keeps_its_verdict(course: Course) -> None:
    asked = {"kind": "numeric", "q": "Twice {a}?", "answer": 4, "verify": {"by": "expression", "expr": "2 * {a}"}}
    course.change(asked=asked | {"draw": {"a": [1, 3]}})
    course.hand_in("ann", 4)
    course.change(asked=asked | {"answer": 8, "draw": {"a": [3, 5]}})
    assert outcomes(course.regrade()) == {"unfit": 1}


def test_an_answer_that_fits_the_question_no_longer_is_kept_and_told(course: Course) -> None:
    ann = course.hand_in("ann", 5)
    course.change(number="mcq")
    shown = course.regrade()
    assert shown["status"] == "done"
    assert outcomes(shown) in ({"unfit": 1}, {"changed": 1})
    newest = course.verdicts(ann)[-1]
    assert newest[0] == "grading" or newest[1] == "invalid_answer"


@pytest.mark.parametrize(("scope", "chosen"), [("latest", [2]), ("best", [1]), ("all", [0, 1, 2, 3])])
def test_a_scope_chooses(course: Course, scope: Scope, chosen: list[int]) -> None:
    made = [course.hand_in("ann", answer) for answer in (6, 5, 7)]
    made.append(course.hand_in("ann", "gibberish"))
    course.hand_in("ann", "Because.", question="text")
    regrade_id = course.start(scope, question="number")
    course.work()
    [item] = course.shown(regrade_id)["items"]
    assert [submission["submission_id"] for submission in item["submissions"]] == [made[index] for index in chosen]


@pytest.mark.parametrize("scope", ["latest", "best", "all"])
def test_what_we_failed_to_grade_is_in_every_scope_where_it_is_the_newest(course: Course, scope: Scope) -> None:
    def fail(learner: str) -> str:
        failed = course.queue(learner, 5)
        course.append(failed, Verdict(status=Status.GRADER_FAULT, points=0.0, max_points=2.0), "grading")
        return failed

    course.hand_in("ann", 6)
    failed = [fail("ann"), fail("bob")]  # bob has no other
    course.hand_in("ann", "gibberish")  # uses no attempt
    passed = fail("cem")
    course.hand_in("cem", 5)
    shown = course.regrade(scope)
    chosen = {one["submission_id"] for item in shown["items"] for one in item["submissions"]}
    assert set(failed) <= chosen
    assert (passed in chosen) == (scope == "all")
    assert [course.verdicts(one)[-1] for one in failed] == [("regrade", "correct", 2.0)] * 2
    assert [course.points(learner) for learner in ("ann", "bob", "cem")] == [2.0] * 3


def test_the_best_one_is_the_best_with_its_late_multiplier(course: Course) -> None:
    course.change(policy=LATE_POLICY)
    course.hand_in("ann", 6, DUE - timedelta(hours=1))
    late = course.hand_in("ann", 5, DUE + timedelta(days=1, hours=1))
    course.hand_in("ann", 5, DUE + timedelta(days=2, hours=1))
    [item] = course.regrade("best", dry_run=True)["items"]
    assert [submission["submission_id"] for submission in item["submissions"]] == [late]


def test_submissions_may_be_named_and_must_be_of_the_course(course: Course) -> None:
    ann, bob = course.hand_in("ann", 5), course.hand_in("bob", 5)
    course.change(key=6)
    assert list(told(course.regrade((bob,)))) == ["bob"]
    assert (course.points("ann"), course.points("bob")) == (2, 0)
    with pytest.raises(NotFound):
        course.start(("f" * 32, ann))
    other = Identity("x", "X", Role.INSTRUCTOR, "elsewhere")
    with pytest.raises(NotFound):
        regrades.create(
            course.database, course.content.library, other, RegradeRequest("quiz", None, (ann,), dry_run=True)
        )
    with pytest.raises(NotFound):
        course.start(question="gone")


def test_nothing_to_regrade_is_done_at_once(course: Course) -> None:
    shown = course.shown(course.start())
    assert (shown["status"], shown["progress"]["total"], shown["items"]) == ("done", 0, [])


def test_a_regrade_waits_for_what_is_still_being_graded(course: Course) -> None:
    ann = course.queue("ann", 5)
    course.change(key=6)
    regrade_id = course.start()
    worker = course.worker()
    for _ in range(3):
        assert worker.do_one()
    assert course.shown(regrade_id)["status"] == "running"
    course.append(ann, Verdict(status=Status.CORRECT, points=2, max_points=2), "grading")
    course.work()
    shown = course.shown(regrade_id)
    assert (shown["status"], told(shown)) == ("done", {"ann": (2, 0, -2)})


def test_a_cancelled_regrade_stops_and_keeps_what_it_did(course: Course) -> None:
    made = [course.hand_in(f"user{number:02}", 5) for number in range(30)]
    course.change(key=6)
    regrade_id = course.start()
    worker = course.worker()
    assert worker.do_one()
    with pytest.raises(Conflict):
        course.start()
    with course.database.write() as session:
        regrades.cancel(session, course.tina, regrade_id)
        regrades.cancel(session, course.tina, regrade_id)
    course.work()
    shown = course.shown(regrade_id)
    assert shown["status"] == "cancelled"
    done = [one for one in made if len(course.verdicts(one)) == 2]
    assert 0 < len(done) == shown["progress"]["done"] < 30
    with course.database.read() as session:
        assert jobs.count_jobs(session) == 0
    assert outcomes(course.regrade()) == {"changed": 30 - len(done), "same": len(done)}
    over = course.start()
    course.work()
    with pytest.raises(Conflict), course.database.write() as session:
        regrades.cancel(session, course.tina, over)


@pytest.mark.parametrize(("is_over", "told"), [(False, (None, None)), (True, (2.0, 1.0))])
def test_a_regrade_that_is_over_tells_what_it_changed_of_a_learner(
    is_over: bool, told: tuple[float | None, float | None]
) -> None:
    points = {"changed": (1.0, 2.0), stored.WAITING: (None, None)}
    rows: list[tuple[stored.RegradeItem, str | None]] = [
        (stored.RegradeItem(number=number, place=1, submission_id=str(number), learner="ann", question="number",
                            outcome=outcome, counted_before=before, counted_after=after), "Ann")
        for number, (outcome, (before, after)) in enumerate(points.items(), 1)
    ]  # fmt: skip
    (difference,) = regrades.compare_points(rows, is_over=is_over)
    assert (difference["after"], difference["difference"]) == told


def test_a_regrade_that_was_cancelled_while_a_piece_was_graded_stores_nothing_of_it(course: Course) -> None:
    ann = course.hand_in("ann", 5)
    course.change(key=6)
    judge = course.regrading.judge
    regrade_id = course.start()

    def cancelled_meanwhile(submission: Submission, digest: str) -> Verdict:
        with course.database.write() as session:
            regrades.cancel(session, course.tina, regrade_id)
        return judge(submission, digest)

    course.work(Regrading(course.database, course.content.archive, cancelled_meanwhile, Retries(3, pause_s=0.0)))
    assert len(course.verdicts(ann)) == 1
    assert course.shown(regrade_id)["status"] == "cancelled"


def test_a_worker_that_dies_in_the_middle_leaves_nothing_doubled(
    course: Course, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = [course.hand_in(f"user{number:02}", 5) for number in range(25)]
    course.change(key=6)
    append = counting.append_verdict
    calls: list[None] = []

    def dies(*arguments: Any, **more: Any) -> None:
        calls.append(None)
        append(*arguments, **more)
        if len(calls) in (2, 5, 6):
            raise SystemExit  # in the transaction, after some verdicts: as a kill, it is not caught

    monkeypatch.setattr(counting, "append_verdict", dies)
    regrade_id = course.start()
    deaths = 0
    while True:
        worker = course.worker(tries=20)
        try:
            if not worker.do_one():
                break
        except SystemExit:
            deaths += 1
            with course.database.write() as session:
                jobs.release(session, [lease for _, lease in jobs.list_owned(session)])
    assert deaths == 3
    shown = course.shown(regrade_id)
    assert (shown["status"], outcomes(shown)) == ("done", {"changed": 25})
    assert all([cause for cause, _, _ in course.verdicts(one)] == ["grading", "regrade"] for one in made)


def test_many_workers_regrade_each_submission_once(course: Course) -> None:
    made = [course.hand_in(f"user{number:02}", 5) for number in range(40)]
    course.change(key=6)
    regrade_id = course.start()
    workers = [course.worker() for _ in range(2)]
    for worker in workers:
        worker.start()
    deadline = datetime.now(UTC) + timedelta(seconds=120)
    while course.shown(regrade_id)["status"] != "done" and datetime.now(UTC) < deadline:
        pass
    for worker in workers:
        worker.stop()
    assert outcomes(course.shown(regrade_id)) == {"changed": 40}
    assert all([cause for cause, _, _ in course.verdicts(one)] == ["grading", "regrade"] for one in made)


def test_a_regrade_goes_by_the_content_of_its_start(course: Course) -> None:
    course.hand_in("ann", 5)
    course.change(key=6)
    regrade_id = course.start()
    course.change(key=5)
    course.work()
    assert told(course.shown(regrade_id)) == {"ann": (2, 0, -2)}


def test_a_regrade_whose_content_is_lost_fails_and_takes_no_points(course: Course) -> None:
    course.hand_in("ann", 5)
    course.change(key=8)
    regrade_id = course.start()
    with course.database.write() as session:
        kept = session.execute(select(ContentFile.sha256, ContentFile.body)).all()
        session.execute(delete(ContentFile))
    try:
        archive = Archive(course.database)
        judge = make_judge(archive, Graders(0, allow_t2=False))
        course.work(Regrading(course.database, archive, judge, Retries(2, pause_s=0.0)))
    finally:
        with course.database.write() as session:
            session.add_all(ContentFile(sha256=row.sha256, body=row.body) for row in kept)
    shown = course.shown(regrade_id)
    assert (shown["status"], shown["reason"]) == ("failed", background.OUR_FAULT)
    assert course.points("ann") == 2


def test_the_changed_ones_can_be_listed_alone(course: Course) -> None:
    course.hand_in("ann", 5)
    course.hand_in("bob", 6)
    course.change(key=6)
    course.hand_in("eve", 7)
    regrade_id = course.start(dry_run=True)
    course.work()
    assert list(told(course.shown(regrade_id, changed=True))) == ["ann", "bob"]


def test_a_piece_that_kills_its_worker_every_time_ends_the_regrade(course: Course) -> None:
    course.hand_in("ann", 5)
    course.change(key=6)
    regrade_id = course.start()
    for _ in range(3):
        with course.database.write() as session:
            assert jobs.claim(session, 1)
            jobs.release(session, [lease for _, lease in jobs.list_owned(session)])
    course.work()
    shown = course.shown(regrade_id)
    assert (shown["status"], shown["reason"], shown["progress"]["done"]) == ("failed", background.OUR_FAULT, 0)
    assert course.points("ann") == 2


class Term(RuleBasedStateMachine):
    """A term: answers, new keys and policies, reviews, and regrades that are started, worked on and cancelled."""

    database: Database
    folder: Path

    @initialize()
    def begin(self) -> None:
        with self.database.write() as session:
            session.execute(delete(jobs.JobRow))
        self.course = Course(self.database, self.folder / secrets.token_hex(6))
        self.made: list[str] = []
        self.key, self.policy = 5, "best"

    @rule(learner=st.sampled_from(["ann", "bob"]), answer=st.integers(5, 7))
    def hand_in(self, learner: str, answer: int) -> None:
        self.made.append(self.course.hand_in(learner, answer))

    @rule(key=st.integers(5, 7), policy=st.sampled_from(["best", "latest", "average"]))
    def change(self, key: int, policy: str) -> None:
        self.key, self.policy = key, policy
        self.course.change(key=key, policy={"counts": policy})

    @precondition(lambda self: self.made)
    @rule(index=st.integers(0, 100), points=st.sampled_from([0.0, 1.0, 2.0]))
    def review(self, index: int, points: float) -> None:
        self.course.review(self.made[index % len(self.made)], points)

    @rule(scope=st.sampled_from(["latest", "best", "all"]), dry_run=st.booleans())
    def start(self, scope: Scope, dry_run: bool) -> None:
        with suppress(Conflict):
            self.newest = self.course.start(scope, dry_run)

    @rule()
    def work_a_little(self) -> None:
        self.course.worker().do_one()

    @precondition(lambda self: hasattr(self, "newest"))
    @rule()
    def cancel(self) -> None:
        with suppress(Conflict), self.course.database.write() as session:
            regrades.cancel(session, self.course.tina, self.newest)

    @rule()
    def regrade_all(self) -> None:
        """The dry run tells what applying does; then every verdict is a person's or that of the content as it is."""
        self.course.work()
        tried = self.course.regrade(dry_run=True)
        done = self.course.regrade()
        assert (tried["status"], done["status"]) == ("done", "done")
        assert (told(done), outcomes(done)) == (told(tried), outcomes(tried))
        assert set(outcomes(self.course.regrade())) <= {"same", "reviewed"}
        for one in self.made:
            cause, status, _ = self.course.verdicts(one)[-1]
            with self.course.database.read() as session:
                answer = json.loads(session.get_one(Submission, one).answer)
            assert cause == "review" or status == ("correct" if answer == self.key else "incorrect")
        for learner in ("ann", "bob"):
            self.check_what_counts(learner)

    def check_what_counts(self, learner: str) -> None:
        key = LearnerAt(self.course.name, learner, "quiz", "number")
        with self.course.database.read() as session:
            attempts = [counting.make_attempt(row) for row in results.list_attempts(session, key)]
        counted = count_points(attempts, self.course.content.library.quiz("quiz").default_policy, None)
        assert self.course.points(learner) == (counted.points if attempts else None)

    @invariant()
    def no_verdict_is_doubled_and_no_review_regraded(self) -> None:
        for one in getattr(self, "made", []):
            for (before, said), (after, says) in pairwise(self.course.said(one)):
                assert after != "regrade" or (before != "review" and says != said)


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_term_of_regrades(backend: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(background, "LOOK_S", 0.0)
    with database_url(backend, tmp_path) as url:
        Term.database, Term.folder = Database(url), tmp_path
        Term.database.migrate()
        histories = 6 if Term.database.is_sqlite else 3
        run_state_machine_as_test(Term, settings=settings(max_examples=histories, stateful_step_count=15))
        Term.database.close()


def test_an_answer_to_content_that_is_lost_is_shown_as_it_stands_and_looked_for_once(
    course: Course, monkeypatch: pytest.MonkeyPatch
) -> None:
    course.change(asked={"kind": "mcq", "options": ["a", "b"], "answer": 1})
    handed_in = [course.hand_in(name, 1) for name in ("ann", "ben")]
    course.change(asked={"kind": "mcq", "options": ["b", "a"], "answer": 1})
    archive, tried = Archive(course.database), list[str]()

    def lose(quiz: str, digest: str) -> Pipeline:
        tried.append(digest)
        raise ContentLost(digest)

    digests = {"quiz": course.content.library.digest("quiz")}
    archive._hold(digests["quiz"], course.content.pipeline)
    monkeypatch.setattr(archive, "_taken", lose)
    with course.database.read() as session:
        rows = [session.get_one(Submission, each) for each in handed_in]
        assert [archive.show_in(digests, row) for row in rows] == [1, 1]
        assert tried == [rows[0].content_digest]
