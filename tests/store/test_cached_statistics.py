"""Cached statistics equal new ones, whatever has changed since."""

import random
from collections.abc import Iterator
from pathlib import Path

import pytest
from sqlalchemy import select

from grader.courses.reporting.quiz_statistics import Statistics, Version
from grader.questions import Quiz
from grader.store import results
from grader.store.engine.database import Database
from grader.store.tables import Member, Result
from support.databases import BACKENDS, open_database
from support.seeding import Course, seed

COURSE = Course(learners=12, questions=3, submissions=36)
QUIZ = Quiz.model_validate(
    {
        "id": COURSE.quiz,
        "title": "Large",
        "questions": [
            {"id": f"q{n}", "kind": "mcq", "q": "?", "options": ["a", "b", "c"], "answer": 1} for n in (1, 2, 3)
        ],
    }
)


@pytest.fixture(params=BACKENDS)
def database(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Database]:
    with open_database(request.param, tmp_path) as database:
        seed(database, COURSE)
        yield database


def change(database: Database, chance: random.Random) -> None:
    """What happens in a course: a learner gets points and is told a mistake, waits for a person, or has a new name."""
    learner, question = COURSE.learner(chance.randrange(COURSE.learners)), f"q{chance.randint(1, 3)}"
    with database.write() as session:
        one = session.scalars(select(Result).where(Result.learner == learner, Result.question == question)).one()
        one.points, one.is_final, one.diagnoses = chance.random(), chance.random() < 0.8, '["A mistake."]'
        one.changes += 1
        member = session.get_one(Member, COURSE.learner(chance.randrange(COURSE.learners)))
        member.name = f"name{chance.randrange(1000)}"
        results.touch(session, COURSE.name, member.id)


def test_cached_statistics_are_those_that_would_be_computed_now(database: Database) -> None:
    chance, statistics = random.Random(3), Statistics(database)
    for _ in range(12):
        change(database, chance)
        hidden = (COURSE.learner(chance.randrange(3)), "q1")
        unseen = frozenset(chance.sample([hidden], chance.randint(0, 1)))
        with database.read() as session:
            state = results.state(session, COURSE.name, [COURSE.quiz])
        version = Version(COURSE.name, QUIZ, "digest", frozenset([COURSE.learner(0)]), unseen, state)
        computed = Statistics(database).compute(version)
        assert statistics.compute(version) == statistics.compute(version) == computed
        assert computed.learners == COURSE.learners - 1
    assert statistics.compute.cache_info().hits >= 12
