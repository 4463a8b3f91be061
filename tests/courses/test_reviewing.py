"""Reviewing against a model: claims, heartbeats, marks, second marks, new attempts, and rubrics that change."""

import json
import secrets
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule, run_state_machine_as_test

from grader.courses.answering import results
from grader.courses.people.identity import Identity, Role
from grader.courses.people.pseudonyms import Blinding
from grader.courses.reviewing import reviews, rubric_changes
from grader.courses.reviewing.blinding import hide_names
from grader.courses.reviewing.desk import Desk
from grader.courses.rules.rubric import Mark
from grader.domain.verdict import Status, Verdict
from grader.errors import Conflict, NotFound
from grader.library import Library, load
from grader.store import intake, submissions
from grader.store.engine.database import Database
from grader.store.intake import AnswerKeys
from grader.store.results import LearnerAt
from grader.store.reviewing import reviews as stored
from grader.store.submissions import SubmissionFilter
from grader.store.tables import Result, Submission, VerdictRow, now
from support.databases import BACKENDS, open_database

RUBRICS = ({"a": 3.0, "b": 1.0, "c": -0.5}, {"a": 2.0, "b": 2.0, "c": -2.0})
QUIZZES: dict[str, dict[str, Any]] = {
    "twice": {"second_marking": {"share": 1, "tolerance": 1}},
    "once": {"policy": {"counts": "average"}},
}
"""In the first every answer gets two marks, and the newest attempt waits; in the second all attempts wait."""

POINTS = 4.0
TOLERANCE = 1.0


def a_library(root: Path, rubric: dict[str, float]) -> Library:
    items = [{"id": name, "title": name, "points": points} for name, points in rubric.items()]
    question = {"kind": "open", "id": "why", "q": "Why?", "points": POINTS, "rubric": items}
    (root / "quizzes").mkdir(parents=True)
    for name, rules in QUIZZES.items():
        quiz = {"id": name, "title": name, "questions": [question], **rules}
        (root / "quizzes" / f"{name}.json").write_text(json.dumps(quiz))
    return load(root)


@pytest.fixture(scope="module")
def libraries(tmp_path_factory: pytest.TempPathFactory) -> list[Library]:
    """The content before and after a change of the rubric's points."""
    return [a_library(tmp_path_factory.mktemp("content"), rubric) for rubric in RUBRICS]


@pytest.fixture(scope="module", params=BACKENDS)
def database(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Database]:
    with open_database(request.param, tmp_path_factory.mktemp("data")) as database:
        yield database


@dataclass
class Given:
    """A mark in the model."""

    by: str
    mark: Mark

    def points(self, rubric: dict[str, float]) -> float:
        if self.mark.points is not None:
            return self.mark.points
        assert self.mark.ticked is not None
        return min(max(sum(rubric[name] for name in self.mark.ticked), 0.0), POINTS)


@dataclass
class Answer:
    """A submission in the model."""

    id: str
    learner: str
    quiz: str
    first: Given | None = None
    second: Given | None = None
    settled: bool = False
    """Whether there was a decision after the second mark."""
    revision: int = 1


marks = st.one_of(
    st.builds(Mark, st.none(), st.sampled_from([0.0, 0.5, 2.0, 4.0])),
    st.builds(Mark, st.lists(st.sampled_from("abc"), unique=True).map(tuple), st.none()),
    st.builds(Mark, st.just(("a",)), st.just(1.5)),
)
reviewers = st.sampled_from(["tina", "tom", "tess"])
quizzes = st.sampled_from(sorted(QUIZZES))
places = st.integers(0, 5)


class Reviewing(RuleBasedStateMachine):
    """The service beside its model."""

    database: Database
    libraries: list[Library]

    @initialize()
    def begin(self) -> None:
        self.course = f"course-{secrets.token_hex(4)}"
        self.blinding = Blinding(b"secret")
        self.version = 0
        self.answers: list[Answer] = []
        self.claims: dict[str, tuple[str, datetime]] = {}
        self.clock = datetime(2026, 3, 1, tzinfo=UTC)
        self.patch = pytest.MonkeyPatch()
        self.patch.setattr(reviews, "now", lambda: self.clock)
        self.add("ann", "twice")

    def teardown(self) -> None:
        self.patch.undo()

    @property
    def desk(self) -> Desk:
        return Desk(self.database, self.libraries[self.version], self.blinding)

    @property
    def rubric(self) -> dict[str, float]:
        return RUBRICS[self.version]

    def who(self, name: str) -> Identity:
        return Identity(f"id-{name}", name, Role.INSTRUCTOR, self.course)

    def holder(self, answer: Answer) -> str | None:
        by, until = self.claims.get(answer.id, ("", self.clock))
        return by if until > self.clock else None

    def waits_for(self, answer: Answer, reviewer: str, *, second: bool) -> bool:
        replaced = any(one.id > answer.id and one.learner == answer.learner and one.quiz == answer.quiz
                       for one in self.answers)  # fmt: skip
        if second:
            return self.lacks_second(answer, reviewer)
        return answer.first is None and not (replaced and answer.quiz == "twice")

    def lacks_second(self, answer: Answer, reviewer: str) -> bool:
        if answer.quiz != "twice" or answer.first is None or answer.second is not None:
            return False
        return answer.first.by != reviewer

    def differs(self, answer: Answer) -> bool:
        if answer.second is None or answer.settled:
            return False
        assert answer.first is not None
        return abs(answer.first.points(self.rubric) - answer.second.points(self.rubric)) > TOLERANCE

    @rule(learner=st.sampled_from(["ann", "bob"]), quiz=quizzes)
    def hand_in(self, learner: str, quiz: str) -> None:
        if len(self.answers) < 6:
            self.add(learner, quiz)

    def add(self, learner: str, quiz: str) -> None:
        number = f"{int(self.course[-8:], 16):016x}{len(self.answers):016x}"
        row = Submission(id=number, course=self.course, learner=learner, user=learner, quiz=quiz, question="why",
                         answer='"Because."', content_digest="d", attempt=len(self.answers) + 1)  # fmt: skip
        verdict = Verdict(status=Status.NEEDS_REVIEW, points=0, max_points=POINTS)
        with self.database.write() as session:
            place = LearnerAt.from_submission(row)
            new = results.NewSubmission(self.desk.library, row, verdict, place)
            (stored,) = intake.read(session, [AnswerKeys(place)], now())
            results.store_new(session, [new], {place: stored.state}, now())
        self.answers.append(Answer(number, learner, quiz))

    @rule(reviewer=reviewers, quiz=st.none() | quizzes, second=st.booleans())
    def claim_next(self, reviewer: str, quiz: str | None, second: bool) -> None:
        waiting = [answer for answer in self.answers
                   if self.waits_for(answer, reviewer, second=second) and quiz in (None, answer.quiz)]  # fmt: skip
        free = [one for one in waiting if self.holder(one) is None]
        own = [one for one in waiting if self.holder(one) == reviewer]
        expected = next(iter([*free, *own]), None)
        who = self.who(reviewer)
        with self.database.write() as session:
            queue = reviews.list_queue(
                self.desk, session, SubmissionFilter(self.course, quiz=quiz), who.id if second else None
            )
            if expected is None:
                with pytest.raises(NotFound):
                    reviews.next_to_claim(session, queue, who)
                return
            next_answer = reviews.next_to_claim(session, queue, who)
            reviews.claim(session, who, next_answer, second=second)
        assert next_answer.id == expected.id
        self.claims[next_answer.id] = (reviewer, self.clock + reviews.CLAIM)

    @rule(reviewer=reviewers, place=places, second=st.booleans())
    def claim_one(self, reviewer: str, place: int, second: bool) -> None:
        answer = self.answers[place % len(self.answers)]
        allowed = self.holder(answer) in (None, reviewer) and (not second or self.lacks_second(answer, reviewer))
        with self.database.write() as session:
            row = session.get_one(Submission, answer.id)
            if not allowed:
                with pytest.raises(Conflict):
                    reviews.claim(session, self.who(reviewer), row, second=second)
                return
            reviews.claim(session, self.who(reviewer), row, second=second)
        self.claims[answer.id] = (reviewer, self.clock + reviews.CLAIM)

    @rule(reviewer=reviewers, place=places)
    def prolong(self, reviewer: str, place: int) -> None:
        answer = self.answers[place % len(self.answers)]
        with self.database.write() as session:
            row = session.get_one(Submission, answer.id)
            if self.holder(answer) != reviewer:
                with pytest.raises(Conflict):
                    reviews.prolong(session, self.who(reviewer), row)
                return
            reviews.prolong(session, self.who(reviewer), row)
        self.claims[answer.id] = (reviewer, self.clock + reviews.CLAIM)

    @rule(reviewer=reviewers, place=places)
    def release(self, reviewer: str, place: int) -> None:
        answer = self.answers[place % len(self.answers)]
        with self.database.write() as session:
            reviews.release(session, self.who(reviewer), session.get_one(Submission, answer.id))
        if self.holder(answer) == reviewer:
            del self.claims[answer.id]

    @rule(minutes=st.sampled_from([1, 8, 20]))
    def pass_time(self, minutes: int) -> None:
        self.clock += timedelta(minutes=minutes)

    @rule(reviewer=reviewers, place=places, mark=marks)
    def decide(self, reviewer: str, place: int, mark: Mark) -> None:
        answer = self.answers[place % len(self.answers)]
        with self.database.write() as session:
            row = session.get_one(Submission, answer.id)
            self.desk.hold(session, row)
            if self.holder(answer) not in (None, reviewer) or self.lacks_second(answer, reviewer):
                with pytest.raises(Conflict):
                    reviews.decide(self.desk, session, self.who(reviewer), row, mark)
                return
            reviews.decide(self.desk, session, self.who(reviewer), row, mark)
        answer.settled = answer.second is not None
        answer.first = Given(reviewer, mark)
        answer.revision += 1
        self.claims.pop(answer.id, None)

    @rule(reviewer=reviewers, place=places, mark=marks)
    def mark_second(self, reviewer: str, place: int, mark: Mark) -> None:
        answer = self.answers[place % len(self.answers)]
        with self.database.write() as session:
            row = session.get_one(Submission, answer.id)
            self.desk.hold(session, row)
            if self.holder(answer) not in (None, reviewer) or not self.lacks_second(answer, reviewer):
                with pytest.raises(Conflict):
                    reviews.mark_second(self.desk, session, self.who(reviewer), row, mark)
                return
            reviews.mark_second(self.desk, session, self.who(reviewer), row, mark)
        answer.second = Given(reviewer, mark)
        self.claims.pop(answer.id, None)

    @rule(reviewer=reviewers, place=places)
    def withdraw(self, reviewer: str, place: int) -> None:
        answer = self.answers[place % len(self.answers)]
        is_free = self.holder(answer) in (None, reviewer) and not self.lacks_second(answer, reviewer)
        with self.database.write() as session:
            row = session.get_one(Submission, answer.id)
            self.desk.hold(session, row)
            if answer.first is None or not is_free:
                with pytest.raises(Conflict):
                    reviews.withdraw(self.desk, session, self.who(reviewer), row)
                return
            reviews.withdraw(self.desk, session, self.who(reviewer), row)
        answer.first = answer.second = None
        answer.settled = False
        answer.revision += 1
        self.claims.pop(answer.id, None)

    @rule(place=places, one=marks, other=marks)
    def mark_twice(self, place: int, one: Mark, other: Mark) -> None:
        """Chance alone seldom brings both marks to one answer."""
        self.decide("tina", place, one)
        self.mark_second("tom", place, other)

    @rule()
    def change_the_rubric(self) -> None:
        before = self.rubric
        self.version = 1 - self.version
        for quiz in QUIZZES:
            for one in rubric_changes.list_outdated(self.desk, quiz, "why", self.course):
                rubric_changes.recompute(self.desk, one)
            assert not rubric_changes.list_outdated(self.desk, quiz, "why", self.course)
        for answer in self.answers:
            # Items whose points have changed make a new revision, also where the sum stays.
            ticked = answer.first.mark.ticked if answer.first and answer.first.mark.points is None else ()
            answer.revision += any(before[name] != self.rubric[name] for name in ticked or ())

    @invariant()
    def queues_hold_what_waits(self) -> None:
        with self.database.read() as session:
            for reviewer in ("tina", "tom"):
                for second in (False, True):
                    who = self.who(reviewer)
                    queue = reviews.list_queue(
                        self.desk, session, SubmissionFilter(self.course), who.id if second else None
                    )
                    waiting = stored.page(session, queue, None, 100, self.clock)
                    expected = [answer for answer in self.answers if self.waits_for(answer, reviewer, second=second)]
                    assert [row.id for row, _ in waiting] == [one.id for one in expected]
                    assert [claim and claim.name for _, claim in waiting] == [self.holder(one) for one in expected]

    @invariant()
    def disagreements_are_the_marks_that_differ(self) -> None:
        with self.database.read() as session:
            disagreements = stored.list_disagreements(session, SubmissionFilter(self.course), None, 100)
        assert [row.id for row, _ in disagreements] == [answer.id for answer in self.answers if self.differs(answer)]

    @invariant()
    def the_first_mark_or_the_last_decision_counts(self) -> None:
        with self.database.read() as session:
            rows = {row.id: row for row in submissions.page(session, SubmissionFilter(self.course), None, 100)}
            verdicts = submissions.read_verdicts(session, rows.values())
            for answer in self.answers:
                points = 0.0 if answer.first is None else answer.first.points(self.rubric)
                assert verdicts[answer.id]["points"] == points
                assert rows[answer.id].status == ("needs_review" if answer.first is None else "graded")
                assert rows[answer.id].revision == answer.revision
            kept = session.query(VerdictRow).filter(VerdictRow.course == self.course).count()
            assert kept == sum(one.revision for one in self.answers)

    @invariant()
    def results_count_the_marks(self) -> None:
        with self.database.read() as session:
            for learner, quiz in {(answer.learner, answer.quiz) for answer in self.answers}:
                theirs = [answer for answer in self.answers if (answer.learner, answer.quiz) == (learner, quiz)]
                points = [one.first.points(self.rubric) for one in theirs if one.first is not None] or [0.0]
                result = session.get_one(Result, LearnerAt(self.course, learner, quiz, "why"))
                assert result.points == pytest.approx(max(points) if quiz == "twice" else sum(points) / len(points))
                waiting = theirs[-1:] if quiz == "twice" else theirs
                assert result.is_final == all(one.first is not None for one in waiting)

    @invariant()
    def reviewers_are_blind(self) -> None:
        with self.database.read() as session:
            rows = submissions.page(session, SubmissionFilter(self.course), None, 100)
            verdicts = submissions.read_verdicts(session, rows)
            seen = hide_names(self.desk, session, self.who("tina"), rows, verdicts)
        for answer in self.answers:
            hidden = self.lacks_second(answer, "tina")
            assert (seen.verdicts[answer.id]["status"] == "needs_review") == (hidden or answer.first is None)
            theirs = [one for one in self.answers if (one.learner, one.quiz) == (answer.learner, answer.quiz)]
            assert (answer.id in seen.names) == any(self.is_open(one, theirs) for one in theirs)

    def is_open(self, answer: Answer, theirs: list[Answer]) -> bool:
        """Whether a decision on one of a learner's answers to a quiz is still to come."""
        waits = answer.first is None and (answer.quiz == "once" or answer is theirs[-1])
        return waits or self.lacks_second(answer, "nobody") or self.differs(answer)


@pytest.mark.slow
def test_reviewing_is_what_the_model_says(database: Database, libraries: list[Library]) -> None:
    machine = type("Machine", (Reviewing,), {"database": database, "libraries": libraries})
    histories = 6 if database.is_sqlite else 2  # the rules are the same: PostgreSQL shows that its queries are too
    run_state_machine_as_test(machine, settings=settings(max_examples=histories, stateful_step_count=35))
