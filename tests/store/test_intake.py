"""What is read of the database for new answers."""

from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import event

from grader.store import intake
from grader.store.intake import AnswerKeys
from grader.store.results import LearnerAt
from support.databases import open_database
from support.seeding import Course, seed

COURSE = Course(learners=500, submissions=5_000)


@pytest.mark.postgres
def test_some_new_answers_are_looked_up_beside_thousands_without_reading_a_table(tmp_path: Path) -> None:
    plans: list[str] = []
    keys = [AnswerKeys(LearnerAt(COURSE.name, COURSE.learner(n), COURSE.quiz, "q1"), f"c{n}") for n in range(25)]
    with open_database("postgresql", tmp_path) as database:
        seed(database, COURSE)

        @event.listens_for(database.engine, "before_cursor_execute")
        def explain(_connection: Any, cursor: Any, statement: str, parameters: Any, *_rest: Any) -> None:
            if "wanted" in statement:
                cursor.execute(f"EXPLAIN {statement}", parameters)
                plans.append("\n".join(line for (line,) in cursor.fetchall()))

        with database.write() as session:
            database.lock_learners(session, {(COURSE.name, key.place.learner) for key in keys})
            assert [one.state.progress.used for one in intake.read(session, keys, datetime.now(UTC))] == [2] * 25
    (plan,) = plans
    assert "ix_submissions_attempts" in plan
    assert not [word for word in ("Seq Scan", "Hash", "Merge") if word in plan], plan
