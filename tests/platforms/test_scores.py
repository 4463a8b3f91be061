"""Scores: what is sent for which results, when, and what is left alone; with chosen faults at most."""

import asyncio
import json
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import select
from sqlalchemy.orm import Session

from grader.courses.answering.policies import change_policy
from grader.courses.answering.results import grant
from grader.courses.people.identity import Identity, Role
from grader.courses.sending.outbox import release, release_all, replay, send_scores
from grader.domain.platform import ScoreTarget
from grader.domain.policy import Extension
from grader.grading.content import Contents
from grader.grading.pipeline import Retries
from grader.platforms.sending.access_tokens import AccessTokens
from grader.platforms.sending.delivering import Delivering
from grader.platforms.sending.line_items import LINE_ITEM, READ_LINE_ITEM, READ_RESULT, SCORE, add_path
from grader.platforms.sending.outgoing import Outgoing, Response
from grader.platforms.sending.replies import RETRY_MAX_S, Again, DeadLetter, retry_after_s
from grader.platforms.sending.score import PlatformResult, Score, compute_score
from grader.platforms.sending.scores import NO_PLACE, TRIED_MAX, is_contested
from grader.queue import jobs
from grader.queue.worker import JobOutcome, Worker
from grader.settings import Settings
from grader.store import extensions
from grader.store.engine.database import Database
from grader.store.outbox import SCORES, Delivery, Destination, LinkedColumn
from grader.store.tables import Member, Result, now
from platforms.classes import COURSE, Class
from platforms.profiles import BLACKBOARD, CANVAS_LMS, MOODLE, PROFILES, Grade, Profile, Simulated, place, simulated
from platforms.receivers import HERE, Answer, Asked, receiving
from platforms.sending import sender_of, sign
from platforms.working import database_of, work
from support.databases import BACKENDS, database_url
from support.sites import QUIZ, open_site, write_content

pytestmark = pytest.mark.slow


class Course(Class):
    """A class whose scores go to one platform; `change` alters where."""

    platform: Simulated
    folder: Path
    change: dict[str, Any]
    last: Any
    ahead: timedelta = timedelta()

    def deliver(self, *, forgetful: bool = False, until_s: float = 2.0) -> None:
        """Sends what waits, a second after the last time; `forgetful` with a new process's empty memory."""
        self.ahead += timedelta(seconds=1)
        if forgetful or not hasattr(self, "last"):
            self.last = replace(sender_of(self.database, self.target), clock=lambda: now() + self.ahead)
        work(self.database, {SCORES: self.last}, (0.01,) * 3, until_s)

    def target(self, _session: Any, row: Delivery) -> ScoreTarget | None:
        user = f"lti-{row.learner[:8]}"
        at = (self.platform.platform, self.platform.container, user, f"{row.quiz}/{row.question}")
        return replace(place(*at), **self.change)

    def row(self, number: int = 0) -> Delivery:
        with self.database.read() as session:
            rows = session.scalars(select(Delivery).where(Delivery.learner == self.learners[number].id)).all()
        return rows[-1]

    @property
    def sent(self) -> list[tuple[Any, str]]:
        return [(one.get("scoreGiven"), one["gradingProgress"]) for one in self.platform.taken]

    @property
    def comments(self) -> list[tuple[Any, str | None]]:
        return [(one.get("scoreGiven"), one.get("comment")) for one in self.platform.taken]

    def change_policy(self, policy: dict[str, Any]) -> None:
        set_policy(self.folder, policy)
        self.contents.get(COURSE).reload()

    def set_rules(self, rules: dict[str, Any]) -> None:
        """Sets the policy of the quiz in this course, as an instructor."""
        tina, library = Identity("t" * 32, "tina", Role.INSTRUCTOR, COURSE), self.contents.get(COURSE).library
        change_policy(self.database, library, tina, library.quiz("small"), rules, is_current=lambda _: True)

    def publish(self) -> None:
        with self.database.write() as session:
            extensions.publish(session, COURSE, "small", "tina")
            release(self.database, session, COURSE, "small")

    def extend(self, who: Identity, granted: Extension) -> None:
        with self.database.write() as session:
            learner = session.get_one(Member, who.id)
            library = self.contents.get(COURSE).library
            grant(self.database, library, session, learner, "small", granted=granted, by=None)

    def enter(self, given: float, maximum: float = 4.0) -> None:
        """A person enters a grade for the first learner."""
        (item,) = self.platform.items
        self.platform.enter(item, f"lti-{self.learners[0].id[:8]}", given, maximum)

    def grade(self) -> float | None:
        (item,) = self.platform.items
        return self.platform.grades[item, f"lti-{self.learners[0].id[:8]}"].given


MakeCourse = Callable[..., Course]


def set_policy(folder: Path, policy: dict[str, Any]) -> None:
    (folder / "quizzes" / "small.json").write_text(json.dumps({**QUIZ, "policy": policy}))


both = pytest.mark.parametrize("url", BACKENDS, indirect=True)
"""For what depends on the database: locks, jobs and statements. Which score is sent does not."""


@pytest.fixture
def url(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[str]:
    with database_url(getattr(request, "param", "sqlite"), tmp_path) as url:
        yield url


@pytest.fixture
def make(url: str, tmp_path: Path) -> Iterator[MakeCourse]:
    """Makes a course with one learner at a platform."""
    database = Database(url)
    database.migrate()
    opened = []

    def course(profile: Profile = MOODLE, policy: dict[str, Any] | None = None, **change: Any) -> Course:
        folder = write_content(tmp_path / "content")
        set_policy(folder, policy or {})
        made = Course(database, Contents(folder, {}, database))
        context = simulated(profile)
        opened.append(context)
        made.platform, made.folder, made.change = context.__enter__(), folder, change
        made.enrol(["ann"])
        made.send_scores()
        return made

    yield course
    for context in opened:
        context.__exit__(None, None, None)
    database.close()


@both
@pytest.mark.parametrize("profile", PROFILES, ids=lambda one: one.name)
def test_real_points_of_the_real_maximum(make: MakeCourse, profile: Profile) -> None:
    course = make(profile)
    (ann,) = course.learners
    course.answer([(ann, "q1", 1), (ann, "q2", "5 ms")])
    course.deliver()
    (score,) = course.platform.taken
    assert score["timestamp"].endswith(".000Z")
    assert {name: score[name] for name in ("scoreGiven", "scoreMaximum", "activityProgress", "gradingProgress")} == {
        "scoreGiven": 2.0, "scoreMaximum": 4.0, "activityProgress": "InProgress", "gradingProgress": "FullyGraded",
    }  # fmt: skip
    (item,) = course.platform.items.values()
    assert (item["label"], item["scoreMaximum"], item["resourceId"]) == ("A small quiz", 4.0, "small/")
    assert course.platform.attempts == {}
    assert course.row().state == "sent"


@both
def test_open_answers_wait_as_pending_and_are_final_once(make: MakeCourse) -> None:
    course = make(CANVAS_LMS)
    (ann,) = course.learners
    course.answer([(ann, "q4", "because")])
    course.deliver()
    assert course.sent == [(None, "PendingManual")]
    course.answer([(ann, "q1", 1)])
    course.deliver()
    assert course.sent[1:] == [(1.0, "PendingManual")]
    course.review(ann, 0.5)
    course.deliver()
    assert course.sent[2:] == [(1.5, "FullyGraded")]
    course.answer([(ann, "q4", "another reason")])  # pending again: would take the grade away
    course.deliver()
    assert (course.sent[3:], course.grade()) == ([], 1.5)
    course.review(ann, 1.0)
    course.deliver()
    assert (course.sent[3:], course.grade()) == ([(2.0, "FullyGraded")], 2.0)


def test_a_pending_score_with_the_points_of_the_final_one_is_made_final(make: MakeCourse) -> None:
    """Where pending points are shown, the platform's copy looks final already."""
    course = make(replace(MOODLE, pending_clears=False))
    (ann,) = course.learners
    course.answer([(ann, "q1", 1), (ann, "q4", "because")])
    course.deliver()
    course.enter(1.0)
    course.review(ann, 0.0)
    course.deliver()
    assert course.sent == [(1.0, "PendingManual"), (1.0, "FullyGraded")]


def test_what_has_not_changed_is_not_sent(make: MakeCourse) -> None:
    course = make()
    (ann,) = course.learners
    course.answer([(ann, "q1", 1)])
    course.deliver()
    course.answer([(ann, "q1", 2)])  # the best one counts
    course.send_scores(learner=ann.id)  # one more launch
    course.deliver()
    assert len(course.platform.taken) == 1


@both
def test_what_a_learner_has_before_the_first_launch_is_sent_then(make: MakeCourse) -> None:
    course = make(policy={"attempts": 9})
    course.enrol(["bob"])
    bob = course.learners[1]
    course.answer([(bob, "q2", "5 ms")])
    course.deliver()
    course.send_scores("q2", learner=bob.id)
    course.deliver()
    assert [(one["scoreGiven"], one["scoreMaximum"]) for one in course.platform.taken] == [(1.0, 4.0), (1.0, 1.0)]
    assert [item["label"] for item in course.platform.items.values()] == ["A small quiz", "A small quiz: q2"]


@both
def test_the_column_of_a_link_gets_the_scores_of_those_who_opened_it(make: MakeCourse) -> None:
    course = make()
    course.enrol(["bob"])
    ann, bob = course.learners
    course.answer([(one, "q1", 1) for one in course.learners])
    course.deliver()
    course.platform.taken.clear()
    with course.database.write() as session:
        for link, who in (("x", ann), ("y", bob), ("x", ann)):
            column = LinkedColumn(link, f"https://lms.example/{link}")
            send_scores(course.database, session, COURSE, "small", "q2", learner=who.id, column=column)
    course.answer([(one, "q2", "5 ms") for one in course.learners])
    with course.database.read() as session:
        columns = select(Destination.url, Delivery.learner).join(Delivery, Delivery.destination == Destination.id)
        opened = session.execute(columns.where(Delivery.question == "q2")).all()
    assert sorted(map(tuple, opened)) == sorted([("https://lms.example/x", ann.id), ("https://lms.example/y", bob.id)])
    course.deliver()
    assert len([one for one in course.platform.taken if one["scoreMaximum"] == 1.0]) == 2


@both
def test_a_persons_grade_stays_until_a_person_replays_ours(make: MakeCourse) -> None:
    course = make()
    (ann,) = course.learners
    course.answer([(ann, "q1", 1)])
    course.deliver()
    course.enter(3.5)
    course.answer([(ann, "q2", "5 ms")])
    course.deliver()
    assert (course.grade(), course.row().state) == (3.5, "dead")
    assert course.row().error == "Overridden by a person: the platform has 87.5 of 100. Replay it to replace that."
    course.answer([(ann, "q2", "7 ms")])
    course.deliver()
    assert course.grade() == 3.5
    with course.database.write() as session:
        replay(session, None, course.row().id, COURSE)
    course.deliver()
    assert (course.grade(), course.row().state, course.row().forced) == (2.0, "sent", False)


def test_a_persons_grade_before_ours_stays_and_a_zero_does_not(make: MakeCourse) -> None:
    course = make()
    course.enrol(["bob"])
    ann, bob = course.learners
    course.answer([(bob, "q1", 1)])
    course.deliver()
    (item,) = course.platform.items
    for one, given in ((ann, 2.0), (course.learners[1], 0.0)):
        course.platform.enter(item, f"lti-{one.id[:8]}", given, 4.0)
    course.answer([(ann, "q1", 1)])
    course.deliver()
    assert (course.grade(), course.row().state) == (2.0, "dead")
    course.enrol(["cem"])
    cem = course.learners[2]
    course.platform.enter(item, f"lti-{cem.id[:8]}", 0.0, 4.0)  # as platforms do it when an answer is late
    course.answer([(cem, "q1", 1)])
    course.deliver()
    assert course.row(2).state == "sent"


@pytest.mark.parametrize("profile", [CANVAS_LMS, MOODLE], ids=lambda one: one.name)
@pytest.mark.parametrize(("given", "state"), [(1.0, "sent"), (3.0, "dead")])
def test_a_refusal_as_stale_is_settled_by_reading(make: MakeCourse, profile: Profile, given: float, state: str) -> None:
    """A person enters a grade between our reading and our score; the same one, or another."""
    course = make(profile)
    (ann,) = course.learners

    def meanwhile(asked: Asked) -> str | None:
        if asked.method == "POST" and "/scores" in asked.path:
            course.platform.grades["item0", f"lti-{ann.id[:8]}"] = later(given)
        return None

    course.platform.fault = meanwhile
    course.answer([(ann, "q1", 1)])
    course.deliver()
    assert (course.row().state, course.grade(), course.platform.taken) == (state, given, [])


def later(given: float) -> Grade:
    return Grade(given, 4.0, datetime.now(UTC) + timedelta(seconds=30))


def test_a_platform_whose_clock_is_ahead_gets_a_later_score(make: MakeCourse) -> None:
    course = make()
    (ann,) = course.learners
    course.answer([(ann, "q1", 1)])
    course.deliver()
    (grade,) = course.platform.grades.values()
    grade.timestamp += timedelta(seconds=1)
    course.answer([(ann, "q2", "5 ms")])
    course.deliver()
    assert course.grade() == 2.0
    assert course.row().state == "sent"


@both
def test_timestamps_are_at_least_a_second_apart_and_never_ahead(make: MakeCourse) -> None:
    course = make()
    (ann,) = course.learners
    sender = sender_of(course.database, course.target)
    for question, answer in (("q1", 1), ("q2", "5 ms"), ("q3", 0)):
        course.answer([(ann, question, answer)])
        work(course.database, {SCORES: sender}, until_s=2.0)
        assert datetime.fromisoformat(course.platform.taken[-1]["timestamp"]) <= datetime.now(UTC)
    times = [datetime.fromisoformat(one["timestamp"]) for one in course.platform.taken]
    assert len(times) == 3
    assert all(b - a >= timedelta(seconds=1) for a, b in pairwise(times))


@both
def test_a_score_whose_answer_got_lost_is_not_sent_twice(make: MakeCourse) -> None:
    course = make()
    (ann,) = course.learners

    def lose(asked: Asked) -> str | None:
        if asked.method == "POST" and "/scores" in asked.path:
            course.platform.fault = None
            return "lost after"
        return None

    course.platform.fault = lose
    course.answer([(ann, "q1", 1)])
    course.deliver()
    assert course.sent == [(1.0, "FullyGraded")]
    assert (course.row().state, course.row().tried) == ("sent", None)


@both
@pytest.mark.parametrize("lands", ["after the reading", "after the score"])
def test_a_score_in_flight_at_a_kill_never_replaces_a_later_one(make: MakeCourse, lands: str) -> None:
    """The sender is gone, its request is not: a proxy or the platform's own queue hands it on much later."""
    course = make(policy={"counts": "latest"})
    (ann,) = course.learners
    in_flight: list[Asked] = []

    def keep(asked: Asked) -> str | None:
        if asked.method == "POST" and "/scores" in asked.path:
            in_flight.append(asked)
            return "lost before"
        return None

    def hand_on(asked: Asked) -> str | None:
        if lands == "after the reading" and asked.method == "POST" and "/scores" in asked.path:
            course.platform.fault = None
            course.platform.take(in_flight[0])
        return None

    course.answer([(ann, "q1", 1)])
    course.deliver()
    course.answer([(ann, "q1", 2)])
    course.platform.fault = keep
    course.ahead += timedelta(seconds=1)
    work(course.database, {SCORES: course.last}, (), until_s=2.0)
    assert [one.json()["scoreGiven"] for one in in_flight] == [0.0]
    course.platform.fault = hand_on
    course.answer([(ann, "q1", 1)])  # the platform shows 1.0 as before
    course.deliver(forgetful=True)
    if lands == "after the score":
        assert course.platform.take(in_flight[0]).status == course.platform.profile.stale
    assert (course.grade(), course.row().state, course.row().tried) == (1.0, "sent", None)


def test_which_tries_may_still_replace_a_score() -> None:
    ours, other, third = (Score(given, 4.0, "Completed", "FullyGraded") for given in (1.0, 2.0, 3.0))
    safe: list[tuple[Score | None, list[Score]]] = [
        (None, []), (ours, []), (None, [ours]), (ours, [ours, replace(ours, activity="InProgress")]),
        (None, [other, ours]), (third, [other, other, ours]),
    ]  # fmt: skip
    assert not any(is_contested(ours, sent, tried) for sent, tried in safe)
    unsafe: list[tuple[Score | None, list[Score]]] = [
        (ours, [other]), (ours, [other, ours]), (None, [other]), (None, [ours, other]), (None, [ours, other, ours]),
        (None, [third] * (TRIED_MAX - 1) + [ours]),  # what came before is forgotten
    ]  # fmt: skip
    assert all(is_contested(ours, sent, tried) for sent, tried in unsafe)


@both
def test_many_learners_at_once_make_one_line_item(make: MakeCourse) -> None:
    course = make(BLACKBOARD)
    course.enrol([f"learner{number}" for number in range(12)])
    course.answer([(learner, "q1", 1) for learner in course.learners])
    sender = sender_of(course.database, course.target)
    worker = Worker(course.database, {jobs.DELIVER: Delivering({SCORES: sender})}, 0, Retries(3), 6)
    worker.start()
    try:
        deadline = time.monotonic() + 60
        while len(course.platform.taken) < 13:
            assert time.monotonic() < deadline
            time.sleep(0.02)
    finally:
        worker.stop()
    assert len(course.platform.items) == 1
    assert course.platform.requests.count("POST lineitems") == 1


def test_a_line_item_that_is_there_is_found_by_its_resource_and_kept(make: MakeCourse) -> None:
    course = make(CANVAS_LMS)  # which pages through all of them
    for number in range(5):
        course.platform.items[f"other{number}"] = {"label": "A small quiz", "resourceId": f"other/{number}"}
    course.platform.items["ours"] = {"label": "renamed", "resourceId": "small/"}
    (ann,) = course.learners
    course.answer([(ann, "q1", 1)])
    course.deliver()
    course.answer([(ann, "q2", "5 ms")])
    course.deliver(forgetful=True)
    assert [one["item"] for one in course.platform.taken] == ["ours", "ours"]
    assert course.platform.requests.count("GET lineitems") == 3


def test_the_line_item_of_a_link_is_used_as_it_is(make: MakeCourse) -> None:
    course = make(MOODLE, line_items_url=None)
    course.platform.items["linked"] = {}
    course.change["line_item_url"] = course.platform.url_of("linked")
    (ann,) = course.learners
    course.answer([(ann, "q1", 1)])
    course.deliver()
    assert [one["item"] for one in course.platform.taken] == ["linked"]


@both
def test_a_line_item_that_is_gone_is_a_dead_letter_and_made_anew_by_a_replay(make: MakeCourse) -> None:
    course = make()
    (ann,) = course.learners
    course.answer([(ann, "q1", 1)])
    course.deliver()
    course.platform.items.clear()
    course.answer([(ann, "q2", "5 ms")])
    course.deliver()
    assert course.row().state == "dead"
    assert "no such line item" in (course.row().error or "")
    with course.database.write() as session:
        replay(session, None, course.row().id, None)
    course.deliver()
    assert (len(course.platform.items), course.grade()) == (1, 2.0)


@pytest.mark.parametrize(
    ("scopes", "state", "asked_for"),
    [
        ((SCORE, READ_RESULT, LINE_ITEM, READ_LINE_ITEM, "other"), "sent", {SCORE, READ_RESULT, LINE_ITEM}),
        ((SCORE, LINE_ITEM), "sent", {SCORE, LINE_ITEM}),
        ((SCORE, READ_LINE_ITEM), "dead", {SCORE, READ_LINE_ITEM}),
        ((SCORE,), "dead", None),
        ((LINE_ITEM, READ_RESULT), "dead", None),
    ],
)
def test_only_granted_scopes_are_asked_for(
    make: MakeCourse, scopes: tuple[str, ...], state: str, asked_for: set[str] | None
) -> None:
    course = make(scopes=scopes)
    (ann,) = course.learners
    course.answer([(ann, "q1", 1)])
    course.deliver()
    assert course.row().state == state, course.row().error
    assert [set(request["scope"].split()) for request in course.platform.token_requests] == (
        [asked_for] if asked_for else []
    )


def test_without_the_right_to_read_a_conflict_is_a_dead_letter(make: MakeCourse) -> None:
    course = make(scopes=(SCORE, LINE_ITEM))
    (ann,) = course.learners
    course.answer([(ann, "q1", 1)])
    course.deliver()
    (grade,) = course.platform.grades.values()
    grade.timestamp += timedelta(minutes=1)
    course.answer([(ann, "q2", "5 ms")])
    course.deliver()
    assert course.row().state == "dead"
    assert "may not be read" in (course.row().error or "")
    assert course.grade() == 1.0


def test_a_token_serves_until_it_is_refused_and_is_renewed_once(make: MakeCourse) -> None:
    course = make()
    (ann,) = course.learners
    course.answer([(ann, "q1", 1)])
    course.deliver()
    course.answer([(ann, "q2", "5 ms")])
    course.deliver()
    assert len(course.platform.token_requests) == 1
    course.platform.tokens.clear()
    course.answer([(ann, "q3", 0)])
    course.deliver()
    assert len(course.platform.token_requests) == 2
    assert course.grade() == 3.0
    refusals = course.platform.requests.count("unauthorized")
    course.platform.fault = lambda _: "401"
    course.answer([(ann, "q4", "because")])
    course.review(ann, 1.0)
    course.deliver()
    assert course.row().state == "dead"
    assert course.row().attempts == 3
    assert course.platform.requests.count("unauthorized") == refusals + 2 * 4


def test_tenants_of_one_issuer_have_tokens_of_their_own() -> None:
    with simulated(MOODLE) as one, simulated(MOODLE, client_id="client-2") as two:
        tokens = AccessTokens(Outgoing([HERE]), sign)
        for platform in (one, two, one, two):
            asked = tokens.request(platform.platform, [SCORE], "GET", add_path(platform.container, ""), headers={})
            assert asyncio.run(asked).status == 200
        assert (len(one.token_requests), len(two.token_requests)) == (1, 1)


def test_a_token_is_renewed_before_it_expires() -> None:
    clock = [1_000.0]
    with simulated(MOODLE) as platform:
        tokens = AccessTokens(Outgoing([HERE]), sign, lambda: clock[0])
        for at, count in ((0, 1), (3500, 1), (3545, 2)):
            clock[0] = 1_000.0 + at
            asyncio.run(tokens.request(platform.platform, [SCORE], "GET", platform.container, headers={}))
            assert len(platform.token_requests) == count


@pytest.mark.parametrize(("fault", "state"), [("500", "dead"), ("429", "dead"), ("403", "dead")])
def test_what_may_pass_is_tried_again_and_then_a_dead_letter(make: MakeCourse, fault: str, state: str) -> None:
    course = make()
    (ann,) = course.learners
    course.platform.fault = lambda asked: fault if "/lineitems" in asked.path else None
    course.answer([(ann, "q1", 1)])
    course.deliver()
    assert (course.row().state, course.row().attempts) == (state, 3)
    assert fault in (course.row().error or "")


@pytest.mark.parametrize(
    ("status", "body", "is_retried"),
    [(408, b"", True), (425, b"", True), (429, b"", True), (401, b"", True), (500, b"", True), (599, b"", True),
     (403, b"Rate Limit Exceeded", True), (403, b"forbidden", True), (301, b"", True), (302, b"", True),
     (307, b"", True), (308, b"", True), (402, b"", False), (405, b"", False),
     (415, b"", False), (422, b"no attempt is left", False)],
)  # fmt: skip
def test_which_answers_are_worth_another_try(make: MakeCourse, status: int, body: bytes, is_retried: bool) -> None:
    course = make()
    sender = sender_of(course.database, course.target)
    reply = sender.reply_to(Response(status, {"retry-after": "7"}, body))
    assert isinstance(reply, Again if is_retried else DeadLetter)
    assert not isinstance(reply, Again) or reply.after_s == 7.0


@pytest.mark.parametrize("status", [302, 307, 403])
def test_a_redirection_or_a_missing_right_is_tried_again_and_never_followed(make: MakeCourse, status: int) -> None:
    course = make()
    (ann,) = course.learners
    platform, asked_elsewhere = course.platform, list[Asked]()

    def elsewhere(asked: Asked) -> Answer:
        asked_elsewhere.append(asked)
        return Answer(200)

    with receiving(elsewhere) as port:
        refusals = iter([Answer(status, b"", {"Location": f"http://{HERE}:{port}/scores"})] * 2)
        platform.override = lambda asked: next(refusals, None) if "/scores" in asked.path else None
        course.answer([(ann, "q1", 1)])
        course.deliver()
    assert next(refusals, None) is None
    assert course.sent == [(1.0, "FullyGraded")]
    assert course.row().state == "sent"
    assert asked_elsewhere == []


@both
def test_what_a_reviewer_wrote_travels_with_the_score(make: MakeCourse) -> None:
    course = make()
    (ann,) = course.learners
    course.answer([(ann, "q4", "Because.")])
    course.review(ann, 0.5, "Why <b>the damping</b>?")
    course.deliver()
    assert course.comments == [(0.5, "q4: Why <b>the damping</b>?")]
    course.deliver()
    course.review(ann, 0.5, "Better now.")  # the points stay
    course.deliver()
    assert course.comments[1:] == [(0.5, "q4: Better now.")]
    course.review(ann, 0.5)
    course.deliver()
    assert course.comments[2:] == [(0.5, "")]  # taken back
    course.deliver()
    course.answer([(ann, "q1", 1)])
    course.deliver()
    assert course.comments[3:] == [(1.5, None)]


def test_a_comment_whose_answer_got_lost_is_not_sent_twice(make: MakeCourse) -> None:
    course = make()
    (ann,) = course.learners
    course.answer([(ann, "q4", "Because.")])
    course.review(ann, 1.0, "Well done.")
    lost = iter(["lost after"])
    course.platform.fault = lambda asked: next(lost, None) if "/scores" in asked.path else None
    course.deliver(forgetful=True)
    assert course.comments == [(1.0, "q4: Well done.")]
    assert course.row().state == "sent"


def test_a_comment_reaches_a_platform_where_a_person_entered_the_same_points(make: MakeCourse) -> None:
    course = make()
    (ann,) = course.learners
    course.platform.items["item0"] = {"resourceId": "small/", "byTool": True}
    course.enter(1.0)
    course.answer([(ann, "q4", "Because.")])
    course.review(ann, 1.0, "Well done.")
    course.deliver()
    assert course.comments == [(1.0, "q4: Well done.")]


@both
def test_another_refusal_is_a_dead_letter_at_once(make: MakeCourse) -> None:
    course = make(line_items_url=None)
    course.platform.items["linked"] = {}
    course.change["line_item_url"] = f"{course.platform.origin}/context/1/lineitems/linked?type_id=other"
    (ann,) = course.learners
    course.answer([(ann, "q1", 1)])
    course.deliver()
    assert (course.row().state, course.row().attempts) == ("dead", 0)


@both
def test_a_score_is_held_until_the_learner_may_see_it(make: MakeCourse) -> None:
    course = make(policy={"feedback": "after_publish"})
    (ann,) = course.learners
    course.answer([(ann, "q1", 1)])
    course.deliver()
    assert (course.platform.taken, course.row().state) == ([], "held")
    course.answer([(ann, "q2", "5 ms")])
    course.deliver()
    assert course.row().state == "held"
    course.publish()
    course.deliver()
    assert course.sent == [(2.0, "FullyGraded")]


def later_due() -> str:
    return (now() + timedelta(hours=1)).isoformat()


@both
@pytest.mark.parametrize("feedback", ["after_publish", "after_due"])
def test_a_change_of_the_policy_alone_releases_a_score(make: MakeCourse, feedback: str) -> None:
    course = make(policy={"feedback": feedback, "due": later_due()})
    course.answer([(course.learners[0], "q1", 1)])
    course.deliver(until_s=0.1)
    assert (course.platform.taken, course.row().state) == ([], "held")
    release_all(course.database)  # a server starts; nothing has changed
    course.deliver(until_s=0.1)
    assert (course.platform.taken, course.row().state) == ([], "held")
    course.change_policy({})
    release_all(course.database)
    course.deliver()
    assert (course.sent, course.row().state) == ([(1.0, "FullyGraded")], "sent")


@both
def test_dates_that_the_course_sets_hold_a_score_and_release_it(make: MakeCourse) -> None:
    course = make(policy={"feedback": "after_due", "due": (now() - timedelta(hours=1)).isoformat()})
    course.set_rules({"due": later_due()})
    course.answer([(course.learners[0], "q1", 1)])
    course.deliver(until_s=0.1)
    assert (course.platform.taken, course.row().state) == ([], "held")
    course.set_rules({})  # by the content's due date it was late, but not multiplied
    course.deliver()
    assert (course.sent, course.row().state) == ([(1.0, "FullyGraded")], "sent")


@both
def test_an_extension_that_is_taken_back_releases_a_score(make: MakeCourse) -> None:
    due = now() - timedelta(hours=1)
    course = make(policy={"feedback": "after_due", "due": due.isoformat()})
    (ann,) = course.learners
    course.extend(ann, Extension(due=now() + timedelta(days=1)))
    course.answer([(ann, "q1", 1)])
    course.deliver(until_s=0.1)
    assert course.row().state == "held"
    course.extend(ann, Extension())
    course.deliver()
    assert course.sent == [(1.0, "FullyGraded")]


@both
def test_what_is_published_while_a_sender_decides_to_hold_is_sent(make: MakeCourse) -> None:
    course = make(policy={"feedback": "after_publish"})
    course.answer([(course.learners[0], "q1", 1)])
    delivering = Delivering({SCORES: sender_of(course.database, course.target)})
    worker = Worker(course.database, {jobs.DELIVER: Between(delivering, course.publish)}, 1, Retries(3))
    assert worker.do_one()
    assert course.row().state == "waiting"
    course.deliver()
    assert course.sent == [(1.0, "FullyGraded")]


@dataclass
class Between:
    """Does something after a delivery was decided on, and before that is stored."""

    delivering: Delivering
    happens: Callable[[], None]

    def start(self, session: Session, subject: str) -> Any:
        return self.delivering.start(session, subject)

    def run(self, started: Any) -> JobOutcome:
        outcome = self.delivering.run(started)
        self.happens()
        return outcome

    def give_up(self, started: Any) -> JobOutcome:
        return self.delivering.give_up(started)

    def put_back(self, session: Session, subject: str) -> None:
        self.delivering.put_back(session, subject)


def test_a_server_releases_when_it_starts_and_when_it_loads_content(tmp_path: Path) -> None:
    folder = write_content(tmp_path / "content")
    settings = Settings(content=folder, data=tmp_path / "data", workers=0)
    set_policy(folder, {"feedback": "after_publish"})

    def looked_at(database: Database) -> bool:
        """Whether the score waits to be looked at; then it is held again."""
        with database.write() as session:
            row = session.scalars(select(Delivery)).one()
            state, row.state, row.has_job = row.state, "held", False
        return state == "waiting"

    with open_site(settings) as site:
        database, site.course = database_of(site), COURSE
        with database.write() as session:
            send_scores(database, session, COURSE, "small")
        body = {"quiz": "small", "question": "q1", "answer": 1}
        assert site.client("ann").post("/api/v1/submissions", json=body).status_code == 201
        assert looked_at(database)
        assert not looked_at(database)
        assert site.client("tina", "instructor").post("/api/v1/content:reload").status_code == 200
        assert looked_at(database)
    with open_site(settings) as site:
        assert looked_at(database_of(site))


@both
def test_a_score_is_held_until_the_quiz_closes(make: MakeCourse) -> None:
    due = now() + timedelta(hours=1)
    course = make(policy={"feedback": "after_due", "due": due.isoformat()})
    (ann,) = course.learners
    course.answer([(ann, "q1", 1)])
    work(course.database, {SCORES: sender_of(course.database, course.target)}, until_s=0.1)
    assert course.row().state == "held"
    next_at = course.row().next_at
    assert next_at is not None
    assert timedelta() < next_at - due < timedelta(seconds=5)
    assert course.platform.taken == []


def test_an_instructor_who_tries_has_no_score(make: MakeCourse) -> None:
    course = make()
    course.enrol(["tina"], Role.INSTRUCTOR)
    course.answer([(course.learners[1], "q1", 1)])
    course.deliver()
    assert course.platform.requests == []


def test_a_learner_without_a_platform_has_no_score(make: MakeCourse) -> None:
    course = make()
    course.target = lambda *_: None  # type: ignore[method-assign]
    course.answer([(course.learners[0], "q1", 1)])
    course.deliver()
    assert course.row().state == "sent"
    assert course.platform.requests == []


def test_a_score_that_lost_its_place_after_a_failed_try_is_not_called_sent(make: MakeCourse) -> None:
    course = make()
    course.platform.fault = lambda asked: "500" if "/lineitems" in asked.path else None
    course.answer([(course.learners[0], "q1", 1)])
    course.deliver()
    course.target = lambda *_: None  # type: ignore[method-assign]
    with course.database.write() as session:
        replay(session, None, course.row().id, COURSE)
    course.deliver(forgetful=True)
    assert (course.row().state, course.row().error) == ("dead", NO_PLACE)


def test_a_token_url_that_leads_inside_is_a_dead_letter(make: MakeCourse) -> None:
    course = make()
    course.change["platform"] = replace(course.platform.platform, token_url="https://127.0.0.2/token")
    course.answer([(course.learners[0], "q1", 1)])
    course.deliver()
    assert (course.row().error or "").startswith("The platform's address is not allowed")
    assert "GRADER_PRIVATE_HOSTS of every server and every worker" in (course.row().error or "")


@pytest.mark.parametrize(
    ("url", "part", "query", "expected"),
    [
        ("https://a/l/1", "scores", {}, "https://a/l/1/scores"),
        ("https://a/l/1/?type_id=2", "scores", {}, "https://a/l/1/scores?type_id=2"),
        ("https://a/l/1?x=1&y=a%20b&z=", "results", {"user_id": "u/1"},
         "https://a/l/1/results?x=1&y=a+b&z=&user_id=u%2F1"),
        ("https://a/l?p=1", "", {"resource_id": "q"}, "https://a/l?p=1&resource_id=q"),
    ],
)  # fmt: skip
def test_query_strings_of_line_items_stay(url: str, part: str, query: dict[str, str], expected: str) -> None:
    assert add_path(url, part, **query) == expected


def result(points: float, is_final: bool = True, max_points: float = 2.0) -> Result:
    return Result(points=points, max_points=max_points, is_final=is_final)


def test_the_score_of_results() -> None:
    worth = {"q1": 2.0, "q2": 1.0}
    assert compute_score({}, worth, "") is None
    assert compute_score({"q1": result(1.5)}, worth, "") == Score(1.5, 3.0, "InProgress", "FullyGraded")
    both = {"q1": result(1.5), "q2": result(0.0, is_final=False)}
    assert compute_score(both, worth, "") == Score(1.5, 3.0, "Submitted", "PendingManual")
    assert compute_score(both, worth, "q1") == Score(1.5, 2.0, "Completed", "FullyGraded")
    assert compute_score(both, worth, "q2") == Score(None, 1.0, "Submitted", "PendingManual")
    assert compute_score(both, {}, "q1") == Score(1.5, 2.0, "Completed", "FullyGraded")  # gone from the content
    assert compute_score({"old": result(1)}, worth, "") is None
    assert compute_score({"q1": result(1, max_points=0)}, {"q1": 0.0}, "q1") is None
    tenths = {f"q{number}": result(0.1, max_points=0.1) for number in range(3)}
    assert compute_score(tenths, dict.fromkeys(tenths, 0.1), "") == Score(0.3, 0.3, "Completed", "FullyGraded")
    more = {"q1": result(5, max_points=5)}  # graded before the question got fewer points
    assert compute_score(more, worth, "q1") == Score(5, 5, "Completed", "FullyGraded")
    assert compute_score(more, worth, "") == Score(5, 6, "InProgress", "FullyGraded")


def test_scores_are_compared_as_a_platform_has_scaled_them() -> None:
    score = Score(1 / 3, 4.0, "Completed", "FullyGraded")
    assert score.is_at(PlatformResult(8.33333, 100.0))
    assert not score.is_at(PlatformResult(8.9, 100.0))
    assert Score.from_json(score.to_json()) == score
    listed = [{"userId": "bob", "resultScore": 1}, {"userId": "ann", "resultScore": 3, "resultMaximum": 4}]
    assert PlatformResult.parse(listed, "ann") == PlatformResult(3.0, 4.0)
    useless: list[Any] = [[], {}, None, "x", [1], [{"userId": "ann", "resultScore": True}], [{"userId": "ann"}]]
    for nothing in useless:
        assert PlatformResult.parse(nothing, "ann").score is None


@pytest.mark.parametrize(
    ("text", "seconds"),
    [("7", 7.0), (" 7 ", 7.0), ("", 0.0), ("soon", 0.0), ("-1", 0.0), ("9" * 40, RETRY_MAX_S),
     ("Mon, 05 Oct 2026 09:30:30 GMT", 30.0), ("Mon, 05 Oct 2026 09:29:00 GMT", 0.0), ("٧", 0.0)],
)  # fmt: skip
def test_retry_after_is_read_in_both_forms(text: str, seconds: float) -> None:
    assert retry_after_s({"retry-after": text}, datetime(2026, 10, 5, 9, 30, tzinfo=UTC)) == seconds
