"""Who is stuck: attempts that gain nothing and end in one named mistake; what waits for a person is left out."""

from collections.abc import Iterator
from datetime import timedelta
from itertools import count

import pytest
from sqlalchemy.orm import Session

from grader.courses.reporting.stuck import RECENT, SharedMistake, StuckLearner, find_shared_mistakes, find_stuck
from grader.domain.verdict import Status, Verdict
from grader.store import submissions
from grader.store.engine.database import Database
from grader.store.engine.ids import first_id
from grader.store.reviewing.reviews import NONE
from grader.store.tables import Member, Review, Submission, now
from support.databases import BACKENDS, open_database

COURSE = "robots"
SECONDS = "Right in seconds; milliseconds were asked for."
OTHER = "Twice the right number."
Attempt = tuple[float, str | None]

numbers = count(1)


@pytest.fixture(scope="module", params=BACKENDS)
def database(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Database]:
    with open_database(request.param, tmp_path_factory.mktemp("data")) as database:
        yield database


@pytest.fixture
def session(database: Database) -> Iterator[Session]:
    """A transaction that is rolled back."""
    with Session(database.engine) as session:
        yield session


def learner(session: Session, name: str) -> str:
    member = Member(course=COURSE, id=f"{next(numbers):032x}", name=name, role="student")
    session.add(member)
    session.flush()
    return member.id


def tries(session: Session, name: str, *attempts: Attempt, days: float = 0, question: str = "q2") -> list[str]:
    """Attempts of a new learner, the last one so many days ago. 1 point is right."""
    member, made = learner(session, name), []
    for place, (points, diagnosis) in enumerate(attempts, 1):
        moment = now() - timedelta(days=days) - timedelta(seconds=60 - place)
        status = Status.CORRECT if points == 1 else Status.PARTIAL if points else Status.INCORRECT
        one = Submission(
            id=first_id(moment)[:12] + f"{next(numbers):020x}", course=COURSE, learner=member, user=name, quiz="check",
            question=question, answer='"1"', content_digest="d", attempt=place,
        )  # fmt: skip
        verdict = Verdict(status=status, points=points, max_points=1, diagnosis=diagnosis)
        submissions.add(session, [(one, verdict)])
        made.append(one.id)
    return made


def stuck(session: Session, *without: str) -> list[StuckLearner]:
    session.flush()
    return find_stuck(session, COURSE, without)


def test_three_attempts_with_one_named_mistake_are_stuck_the_longest_first(session: Session) -> None:
    tries(session, "ann", *[(0.0, SECONDS)] * 3)
    tries(session, "bob", (0.0, OTHER), *[(0.0, SECONDS)] * 4)
    learners = stuck(session)
    assert [(one.name, one.quiz, one.question, one.attempts, one.diagnosis) for one in learners] == [
        ("bob", "check", "q2", 5, SECONDS),
        ("ann", "check", "q2", 3, SECONDS),
    ]


@pytest.mark.parametrize(
    "attempts",
    [
        [(0.0, SECONDS)] * 2,
        [(0.0, SECONDS), (0.0, OTHER), (0.0, SECONDS)],
        [(0.0, None)] * 4,
        [(0.0, SECONDS), (0.0, SECONDS), (0.5, SECONDS)],
        [(1.0, None), *[(0.0, SECONDS)] * 3],
    ],
    ids=["two attempts", "other mistakes", "no named mistake", "a gain", "right once"],
)
def test_others_are_not_stuck(session: Session, attempts: list[Attempt]) -> None:
    tries(session, "ann", *attempts)
    assert stuck(session) == []


def test_a_gain_long_ago_does_not_hide_who_is_stuck_since(session: Session) -> None:
    tries(session, "ann", (0.0, SECONDS), *[(0.5, OTHER)] * 4)
    assert [(one.attempts, one.diagnosis) for one in stuck(session)] == [(4, OTHER)]


def test_who_tried_nothing_for_a_week_and_members_left_out_need_nobody(session: Session) -> None:
    tries(session, "ann", *[(0.0, SECONDS)] * 3, days=RECENT.days + 1)
    tries(session, "tom", *[(0.0, SECONDS)] * 3)
    [one] = stuck(session)
    assert one.name == "tom"
    assert stuck(session, one.learner) == []
    session.get_one(Member, one.learner).removed_at = now()
    assert stuck(session) == []


def test_what_a_person_marked_is_left_out(session: Session) -> None:
    *_, newest = tries(session, "ann", *[(0.0, SECONDS)] * 3)
    at = {"course": COURSE, "quiz": "check", "question": "q2", "reviewer": "0" * 32, "name": "tina"}
    session.add(Review(submission_id=newest, **at, points=0.0, second=NONE))
    assert stuck(session) == []


def test_a_mistake_is_shared_by_those_whose_newest_attempt_ends_in_it_and_who_have_not_solved_it(
    session: Session,
) -> None:
    for name in ("ann", "bob", "cat"):
        tries(session, name, (0.0, OTHER), (0.0, SECONDS))
    tries(session, "dan", (0.0, SECONDS), (1.0, None))
    tries(session, "eve", (0.0, SECONDS), days=RECENT.days + 1)
    tries(session, "fay", (0.0, OTHER), question="q3")
    session.flush()
    key = find_shared_mistakes(session, COURSE)[0].key
    assert find_shared_mistakes(session, COURSE) == [
        SharedMistake("check", "q2", key, SECONDS.partition(";")[0], learners=3)
    ]


def test_only_the_newest_submissions_of_a_course_are_looked_at(session: Session) -> None:
    tries(session, "ann", *[(0.0, SECONDS)] * 3)
    tries(session, "bob", *[(0.0, OTHER)] * 3)
    session.flush()
    since = now() - RECENT

    def names(newest: int) -> set[str]:
        return {one.name for one in submissions.find_unsolved(session, COURSE, since, 3, newest=newest, limit=9)}

    assert [names(newest) for newest in (6, 5, 7)] == [{"ann", "bob"}, {"bob"}, {"ann", "bob"}]
