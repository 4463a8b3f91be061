"""Statistics and gradebooks that are kept say what new ones say, whatever has changed since."""

import random
from collections.abc import Iterator
from pathlib import Path

import pytest
from sqlalchemy import select

from databases import BACKENDS, open_database
from grader.api.gradebook import lines_by_name
from grader.courses.gradebook import Column, Form, Sheet, SheetLines
from grader.courses.kept import Parts
from grader.courses.measuring import Seen, Statistics, Version
from grader.domain.quiz import Quiz
from grader.store import results
from grader.store.database import Database
from grader.store.results import LearnerAt
from grader.store.tables import Member, Result
from seeding import Course, seed

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
SHEET = Sheet(COURSE.name, tuple(Column(COURSE.quiz, f"q{n}", f"Title {n}", 1.0) for n in (1, 2, 3)), Form.GENERIC)


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


def test_what_is_kept_is_what_would_be_read_now(database: Database) -> None:
    chance, statistics, kept = random.Random(3), Statistics(), SheetLines(1)
    for _ in range(12):
        change(database, chance)
        hidden = LearnerAt(COURSE.name, COURSE.learner(chance.randrange(3)), COURSE.quiz, "q1")
        unseen = chance.sample([hidden], chance.randint(0, 1))
        with database.read() as session:
            state = results.state(session, COURSE.name, [COURSE.quiz])
            places = frozenset((one.learner, one.question) for one in unseen)
            version = Version(Seen(COURSE.name, COURSE.quiz, "d", frozenset([COURSE.learner(0)]), places), state)
            assert statistics.of(session, QUIZ, version) == Statistics().of(session, QUIZ, version)
            lines, new = (
                list(lines_by_name(session, parts, SHEET, [COURSE.learner(0)], unseen, marks={}))
                for parts in (kept, Parts(1))
            )
            assert lines == new
            assert len(new) == COURSE.learners - 1
