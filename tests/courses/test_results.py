"""Results are what the policy counts, after every change; the feed tells each change once, and skips none."""

import json
import secrets
import threading
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule
from sqlalchemy.orm import Session

from grader.courses.answering import results as counting
from grader.courses.answering.access import read_access
from grader.courses.answering.results import NewSubmission
from grader.courses.people.identity import Identity, Role
from grader.courses.rules.policy import Attempt, count_points
from grader.domain.policy import Extension
from grader.domain.verdict import Status, Verdict
from grader.library import Library, load
from grader.store import extensions, intake, results
from grader.store.engine.bulk import insert_rows
from grader.store.engine.database import Database
from grader.store.engine.ids import make_id
from grader.store.intake import AnswerKeys, QuestionState
from grader.store.results import LearnerAt
from grader.store.submissions import read_values
from grader.store.tables import Member, Result, ResultRevision, Submission, now
from support.databases import BACKENDS, open_database

DUE = datetime(2026, 3, 10, 18, tzinfo=UTC)
DAY = timedelta(days=1)
LATE = {"per_day": 0.5, "floor": 0.2, "until": "2199-12-31T00:00:00Z"}
COUNTS = ("best", "latest", "average")
QUESTIONS = [{"kind": "open", "id": "q1", "q": "Why?", "points": 10}]


def a_library(root: Path) -> Library:
    """Quizzes that differ in what counts, with and without attempts and lateness."""
    (root / "quizzes").mkdir(parents=True)
    for counts in COUNTS:
        for name, more in {"": {}, "-late": {"due": DUE.isoformat(), "late": LATE, "attempts": 3}}.items():
            quiz = {"id": counts + name, "title": counts, "policy": {"counts": counts, **more}, "questions": QUESTIONS}
            (root / "quizzes" / f"{counts}{name}.json").write_text(json.dumps(quiz))
    return load(root)


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    return a_library(tmp_path_factory.mktemp("content"))


@pytest.fixture(scope="module", params=BACKENDS)
def database(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Database]:
    with open_database(request.param, tmp_path_factory.mktemp("data")) as database:
        yield database


@pytest.fixture
def course() -> str:
    return f"course-{secrets.token_hex(6)}"


def a_verdict(status: Status, points: float, diagnosis: str | None = None) -> Verdict:
    return Verdict(status=status, points=points, max_points=10.0, diagnosis=diagnosis, evidence={"value": points})


def an_answer(key: LearnerAt, attempt: int = 1) -> Submission:
    return Submission(id=make_id(), **key._asdict(), user="Ann", answer="1", content_digest="d", attempt=attempt)


def states_at(session: Session, key: LearnerAt) -> dict[LearnerAt, QuestionState]:
    (stored,) = intake.read(session, [AnswerKeys(key)], now())
    return {key: stored.state}


def hand_in(database: Database, library: Library, key: LearnerAt, verdict: Verdict | None) -> Submission:
    submission = an_answer(key)
    with database.write() as session:
        states = states_at(session, key)
        counting.store_new(session, [NewSubmission(library, submission, verdict, key)], states, now())
    return submission


def append(database: Database, library: Library, submission_id: str, verdict: Verdict) -> None:
    with database.write() as session:
        submission = session.get_one(Submission, submission_id)
        counting.append_verdict(database, library, session, submission, verdict, cause="grading")


def the_feed(database: Database, course: str, after: int = 0) -> list[ResultRevision]:
    with database.write() as session:
        database.lock(session, f"feed\n{course}")
        results.number_new(session, course)
    with database.read() as session:
        return [row for row, *_ in results.list_feed(session, course, after, 1000)]


def the_result(database: Database, key: LearnerAt) -> Result | None:
    with database.read() as session:
        return results.find(session, key)


def test_an_average_is_out_of_the_average_of_what_its_attempts_were_out_of(
    database: Database, library: Library, course: str
) -> None:
    key = LearnerAt(course, "ann", "average", "q1")
    hand_in(database, library, key, a_verdict(Status.CORRECT, 10))
    small = a_verdict(Status.CORRECT, 4).model_copy(update={"max_points": 4.0})
    hand_in(database, library, key, small)
    result = the_result(database, key)
    assert result is not None
    assert (result.points, result.max_points) == (7, 7)
    best = LearnerAt(course, "ann", "best", "q1")
    for verdict in (a_verdict(Status.CORRECT, 10), small):
        hand_in(database, library, best, verdict)
    result = the_result(database, best)
    assert result is not None
    assert (result.points, result.max_points) == (10, 10)


def test_a_result_is_revised_where_what_counts_changes(database: Database, library: Library, course: str) -> None:
    key = LearnerAt(course, "ann", "best", "q1")
    first = hand_in(database, library, key, a_verdict(Status.PARTIAL, 4, "A slip."))
    hand_in(database, library, key, a_verdict(Status.PARTIAL, 3, "Another slip."))
    hand_in(database, library, key, a_verdict(Status.INVALID_ANSWER, 0, "Not read."))
    last = hand_in(database, library, key, a_verdict(Status.CORRECT, 10))
    told = [(row.position, row.revision, row.points, row.submission_id) for row in the_feed(database, course)]
    assert told == [(1, 1, 4, first.id), (2, 2, 10, last.id)]
    result = the_result(database, key)
    assert result is not None
    assert (result.points, result.max_points, result.is_final, result.first_status) == (10, 10, True, "partial")
    assert (json.loads(result.diagnoses), result.first_value) == (["A slip.", "Another slip."], 4)


def test_a_regrade_to_a_fault_of_the_grader_takes_the_points_back(
    database: Database, library: Library, course: str
) -> None:
    key = LearnerAt(course, "ann", "best", "q1")
    made = hand_in(database, library, key, a_verdict(Status.PARTIAL, 4))
    append(database, library, made.id, a_verdict(Status.GRADER_FAULT, 0))
    assert [(row.points, row.attempt, row.submission_id) for row in the_feed(database, course)] == [
        (4, 1, made.id),
        (0, None, made.id),
    ]


def test_a_verdict_and_its_result_are_stored_together_or_not_at_all(
    database: Database, library: Library, course: str
) -> None:
    key = LearnerAt(course, "ann", "best", "q1")
    made = hand_in(database, library, key, None)
    with pytest.raises(RuntimeError), database.write() as session:
        submission = session.get_one(Submission, made.id)
        counting.append_verdict(database, library, session, submission, a_verdict(Status.CORRECT, 10), cause="grading")
        raise RuntimeError
    assert the_result(database, key) is None
    assert the_feed(database, course) == []


def test_two_verdicts_at_once_lose_no_points(database: Database, library: Library, course: str) -> None:
    key = LearnerAt(course, "ann", "average", "q1")
    made = [hand_in(database, library, key, None) for _ in range(6)]
    barrier = threading.Barrier(6)

    def grade(points: int) -> None:
        barrier.wait()
        append(database, library, made[points].id, a_verdict(Status.PARTIAL, points))

    threads = [threading.Thread(target=grade, args=(points,)) for points in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    result = the_result(database, key)
    assert result is not None
    assert (result.points, result.is_final) == (2.5, True)
    feed = the_feed(database, course)
    assert [row.revision for row in feed] == list(range(1, len(feed) + 1))


def a_row(course: str, learner: str) -> ResultRevision:
    return ResultRevision(
        course=course, learner=learner, quiz="best", question="q1", attempt=1, points=1.0, max_points=1.0,
        is_late=False, is_final=True, revision=1, created_at=now(),
    )  # fmt: skip


@pytest.mark.parametrize("database", ["postgresql"], indirect=True)
def test_a_reader_of_the_feed_never_skips_a_late_committer(database: Database, library: Library, course: str) -> None:
    """The transaction that drew the lower id commits last, after the feed was read: SQLite has one writer at a time."""
    made = hand_in(database, library, LearnerAt(course, "first", "best", "q1"), a_verdict(Status.PARTIAL, 1))
    assert [row.learner for row in the_feed(database, course)] == ["first"]
    slow, quick = a_row(course, "slow"), a_row(course, "quick")
    slow.submission_id = quick.submission_id = made.id
    with database.write() as late:
        insert_rows(late, (ResultRevision, [read_values(slow)]))
        assert results.has_new(late, course)  # a query, before which the row is sent
        with database.write() as early:
            insert_rows(early, (ResultRevision, [read_values(quick)]))
        seen = the_feed(database, course, after=1)
        assert [row.learner for row in seen] == ["quick"]
    assert seen[-1].position is not None
    rest = the_feed(database, course, after=seen[-1].position)
    assert [row.learner for row in rest] == ["slow"]
    assert rest[0].id < seen[0].id


def test_readers_at_once_number_every_row_once(database: Database, library: Library, course: str) -> None:
    for n in range(20):
        hand_in(database, library, LearnerAt(course, f"u{n}", "best", "q1"), a_verdict(Status.PARTIAL, n))
    feeds: list[list[tuple[int | None, str]]] = []

    def read() -> None:
        feeds.append([(row.position, row.learner) for row in the_feed(database, course)])

    threads = [threading.Thread(target=read) for _ in range(5)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert all(one == [(n + 1, f"u{n}") for n in range(20)] for one in feeds)


class Learning(RuleBasedStateMachine):
    """One learner at one question of each quiz; what is stored must be what the pure policy says of all attempts."""

    database: Database
    library: Library

    @initialize(quiz=st.sampled_from([counts + late for counts in COUNTS for late in ("", "-late")]))
    def begin(self, quiz: str) -> None:
        self.key = LearnerAt(f"course-{secrets.token_hex(8)}", "ann", quiz, "q1")
        self.attempts: list[Attempt] = []
        self.extension = Extension()
        self.told: list[tuple[Any, ...]] = []
        self.position = 0

    verdicts = st.tuples(st.sampled_from(list(Status)), st.integers(0, 10))

    def access(self) -> Any:
        who = Identity("ann", "Ann", Role.STUDENT, self.key.course)
        with self.database.read() as session:
            return read_access(session, self.library, who, (self.key.quiz, "q1"))

    @rule(verdict=st.none() | verdicts)
    def hand_in(self, verdict: tuple[Status, int] | None) -> None:
        decision = self.access().decide(self.key.quiz, "q1")
        used = sum(attempt.uses_attempt for attempt in self.attempts)
        limit = 3 + self.extension.attempts if self.key.quiz.endswith("-late") else None
        assert decision.may_answer == (limit is None or used < limit)
        if decision.may_answer:
            waits = any(
                attempt.status is None for attempt in self.attempts
            )  # scripts wait, and never with instant verdicts
            judged = None if verdict is None or waits else self.judged(verdict)
            made = hand_in(self.database, self.library, self.key, judged)
            self.attempts.append(self.attempt(made, judged))

    @rule(which=st.integers(0, 20), verdict=verdicts)
    def grade(self, which: int, verdict: tuple[Status, int]) -> None:
        """A first verdict, a review or a regrade."""
        if self.attempts:
            place = which % len(self.attempts)
            judged = self.judged(verdict)
            append(self.database, self.library, self.attempts[place].id, judged)
            with self.database.read() as session:
                made = session.get_one(Submission, self.attempts[place].id)
            self.attempts[place] = self.attempt(made, judged)

    def judged(self, verdict: tuple[Status, int]) -> Verdict:
        status, points = verdict
        return a_verdict(status, points, f"{points} points" if points % 2 else None)

    @rule(days=st.integers(0, 400), attempts=st.integers(0, 2))
    def extend(self, days: int, attempts: int) -> None:
        self.extension = Extension(due=DUE + days * DAY if days else None, attempts=attempts)
        ann = Member(id="ann", course=self.key.course, name="Ann")
        with self.database.write() as session:
            counting.grant(self.database, self.library, session, ann, self.key.quiz, granted=self.extension, by=None)
        with self.database.read() as session:
            kept = extensions.list_of_learner(session, self.key.course, "ann", [self.key.quiz])
        assert kept == ({} if self.extension == Extension() else {self.key.quiz: self.extension})

    def attempt(self, made: Submission, verdict: Verdict | None) -> Attempt:
        status = None if verdict is None else verdict.status
        points = 0.0 if verdict is None else verdict.points
        return Attempt(made.id, made.attempt, made.created_at, status, points, status is None or status.uses_attempt)

    @invariant()
    def the_result_is_what_the_policy_counts(self) -> None:
        attempts = sorted(self.attempts, key=lambda attempt: attempt.id)
        expected = count_points(attempts, self.library.quiz(self.key.quiz).default_policy, self.extension)
        result = the_result(self.database, self.key)
        if result is None:
            assert expected.sources == ()
            return
        assert (result.points, result.is_final) == (expected.points, expected.is_final)
        decided = [attempt for attempt in attempts if attempt.uses_attempt and attempt.status is not None]
        if decided:
            assert (result.first_status, result.first_value) == (decided[0].status, decided[0].points)
        told = {f"{attempt.points:.0f} points" for attempt in decided if attempt.points % 2}
        assert json.loads(result.diagnoses) == sorted(told)
        if expected.sources:
            assert (result.submission_id, result.attempt) == (expected.sources[-1].id, expected.numbers[-1])
        else:
            assert (result.points, result.attempt) == (0, None)

    @invariant()
    def the_feed_ends_with_the_result(self) -> None:
        rows = the_feed(self.database, self.key.course, self.position)
        for row in rows:
            assert row.position == self.position + 1
            self.position = row.position
            self.told.append(tuple(getattr(row, name) for name in results.COUNTED))
            assert row.revision == len(self.told)
        result = the_result(self.database, self.key)
        assert (result is None) == (not self.told)
        if result is not None:
            assert self.told[-1] == tuple(getattr(result, name) for name in results.COUNTED)
            assert all(one != other for one, other in zip(self.told, self.told[1:], strict=False))

    @invariant()
    def decisions_depend_on_the_attempts_alone(self) -> None:
        progress = self.access().progress_at(self.key.quiz, "q1")
        used = [attempt for attempt in self.attempts if attempt.uses_attempt]
        assert progress.used == len(used)
        assert progress.pending == sum(attempt.status is None for attempt in used)
        assert progress.solved == any(attempt.status is Status.CORRECT for attempt in used)


@pytest.mark.slow
def test_results_and_decisions_after_any_history(database: Database, library: Library) -> None:
    machine = type("OnThisDatabase", (Learning,), {"database": database, "library": library})
    case = machine.TestCase  # type: ignore[attr-defined]
    case.settings = settings(max_examples=10, stateful_step_count=12)
    case("runTest").runTest()
