"""Cached statistics equal new ones, whatever has changed since, and all equal those of rows counted one by one."""

import json
import random
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import pytest
from sqlalchemy import select

from grader.courses.reporting.quiz_statistics import QuizStatistics, Statistics, Version
from grader.courses.rules.statistics import (
    QuestionStatistics,
    ResultRow,
    find_clusters,
    group_crash,
    item_rest,
    mean_share,
)
from grader.questions import Quiz
from grader.store import results
from grader.store.engine.database import Database
from grader.store.tables import Member, Result
from support.databases import BACKENDS, open_database
from support.seeding import Course, seed

COURSE = Course(learners=40, questions=3, submissions=120)
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
            state = results.read_state(session, COURSE.name, [COURSE.quiz])
        version = Version(COURSE.name, QUIZ, "digest", frozenset([COURSE.learner(0)]), unseen, state)
        computed = Statistics(database).compute(version)
        assert statistics.compute(version) == statistics.compute(version) == computed
        assert computed.learners == COURSE.learners - 1
    assert statistics.compute.cache_info().hits >= 12


def vary(database: Database, chance: random.Random) -> None:
    """Gives every result other points, and an answer of its own: an option, a number, or several of either."""
    crash = "case {}: ZeroDivisionError: division by zero, in line 2 of your script."
    with database.write() as session:
        for result in session.scalars(select(Result)):
            result.max_points, is_right = chance.choice([0.3, 1.0, 2.0]), chance.random() < 0.4
            result.points = result.max_points * (1.0 if is_right else chance.choice([0, 0.1, 1 / 3, 0.7]))
            result.first_status = "correct" if is_right else "incorrect"
            result.first_option = chance.choice([None, 0, 1, 2])
            result.first_value = chance.choice([None, 5.0, 5.01, 0.1 + 0.2, 0.3])
            result.first_several = chance.choice([None, None, '{"option": [0, 2]}'])
            told = [*chance.sample(["A mistake.", "Another.", "A third."], chance.randint(0, 2)), crash.format(1)]
            result.diagnoses = json.dumps([*told, crash.format(2)][: chance.randint(0, 4)])
            result.is_final = chance.random() < 0.9


def count_one_by_one(rows: list[ResultRow]) -> QuizStatistics:
    """The statistics of a quiz whose questions are in alphabetical order, without counting any two rows at once."""
    points, max_points = defaultdict[str, float](float), defaultdict[str, float](float)
    for row in sorted(rows, key=lambda row: row.question):
        points[row.learner] += row.points
        max_points[row.learner] += row.max_points
    names = sorted({row.question for row in rows})
    questions = [count_question([row for row in rows if row.question == name], points, max_points) for name in names]
    return QuizStatistics(len(points), tuple(questions))


def count_question(
    rows: list[ResultRow], points: Mapping[str, float], max_points: Mapping[str, float]
) -> QuestionStatistics:
    """The same of one question, where the learners have these points, and could have these, at all questions."""
    options, mistakes = Counter[int](), Counter[str]()
    for row in rows:
        options.update([] if row.option is None else [row.option])
        options.update(json.loads(row.several or "{}").get("option", ()))
        mistakes.update({group_crash(one) for one in json.loads(row.diagnoses)})
    shares = [row.points / row.max_points for row in rows]
    rest = np.array([points[row.learner] - row.points for row in rows])
    max_rest = np.array([max_points[row.learner] - row.max_points for row in rows])
    wrong = [row.value for row in rows if row.value is not None and row.first_status != "correct"]
    return QuestionStatistics(
        rows[0].question,
        mean_share(shares),
        mean_share([float(row.first_status == "correct") for row in rows]),
        item_rest(np.array(shares), rest, max_rest),
        dict(sorted(options.items())),
        find_clusters(wrong),
        dict(sorted(mistakes.items(), key=lambda mistake: (-mistake[1], mistake[0]))),
    )


def test_statistics_are_bit_for_bit_those_of_rows_counted_one_by_one(database: Database) -> None:
    vary(database, random.Random(5))
    without, hidden = frozenset([COURSE.learner(0)]), frozenset([(COURSE.learner(1), "q2")])
    computed = Statistics(database).compute(Version(COURSE.name, QUIZ, "digest", without, hidden, (1, 1)))
    with database.read() as session:
        rows = [ResultRow(*row) for rows in results.iterate_of_quiz(session, COURSE.name, COURSE.quiz) for row in rows]
    seen = [row for row in rows if row.learner not in without and row[:2] not in hidden]
    assert computed == count_one_by_one(seen)
    assert all(question.discrimination and question.clusters and question.mistakes for question in computed.questions)
