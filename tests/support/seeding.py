"""A course of many learners, inserted by a few statements of plain SQL: what must not slow down as a course grows."""

from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from sqlalchemy import text

from grader.store.engine.database import Database

COUNT = "WITH RECURSIVE n(i) AS (SELECT 0 UNION ALL SELECT i + 1 FROM n WHERE i + 1 < {count})"
LEARNER = "('{course}' || substr(CAST(100000000 + {i} AS text), 2))"
ID = "('{course}' || '0000000000' || substr(CAST(1000000000000 + {i} AS text), 2))"
BODY = (
    '{"status": "correct", "points": 1.0, "max_points": 1.0, "diagnosis": null, "explain": "Because it is.", '
    '"evidence": {"option": 1}, "findings": []}'
)


@dataclass(frozen=True)
class Course:
    """`submissions` of `learners` to the `questions` of one quiz; `name` has 10 characters, and begins every id."""

    name: str = "largecours"
    quiz: str = "large"
    learners: int = 5_000
    questions: int = 8
    submissions: int = 100_000

    def learner(self, number: int) -> str:
        """The id of a learner."""
        return f"{self.name}{number:08d}"


def seed(database: Database, course: Course) -> None:
    """Inserts members, submissions with verdicts and events, results, the feed and idempotency keys."""
    with database.write() as session:
        for count, insert in statements(course):
            query = f"{insert.split(' SELECT ')[0]} {COUNT.format(count=count)} SELECT {insert.split(' SELECT ', 1)[1]}"
            named = {"at": datetime(2026, 1, 1, tzinfo=UTC), "body": BODY, "course": course.name, "quiz": course.quiz}
            session.execute(text(query), {name: on(database, value) for name, value in named.items()})
    with database.engine.connect().execution_options(isolation_level="AUTOCOMMIT") as connection:
        connection.exec_driver_sql("ANALYZE")


def on(database: Database, value: Any) -> Any:
    """A value as the database keeps it."""
    return value.strftime("%Y-%m-%d %H:%M:%S.%f") if database.is_sqlite and isinstance(value, datetime) else value


def statements(course: Course) -> list[tuple[int, str]]:
    """How many rows to make, and from what, where `i` counts them from 0."""
    learners, questions = course.learners, course.questions
    someone = LEARNER.format(course=course.name, i=f"(i % {learners})")
    made = ID.format(course=course.name, i="i")
    name = f"'user' || CAST(i % {learners} AS text)"
    question = f"'q' || CAST(1 + (i / {learners}) % {questions} AS text)"
    place = f":course, {someone}, :quiz, {question}"
    counts = f"{made}, 1, CAST(i % 3 AS float) / 2, 1.0, false, true, 1"
    status = "CASE WHEN i % 50 = 0 THEN 'needs_review' ELSE 'graded' END"
    submission = f"{made}, {place}, {name}, '1', 'd', {status}, 1 + i / {learners * questions}, true, 'correct', 1, 1"
    values = {
        "members (id, course, name, account, role, created_at)": (
            f"{someone}, :course, {name}, 'name:' || {name}, 'student'"
        ),
        'submissions (id, course, learner, quiz, question, "user", answer, content_digest, status, attempt, '
        "uses_attempt, outcome, revision, version, created_at)": submission,
        "verdicts (submission_id, revision, cause, status, points, max_points, course, content_digest, body, "
        "created_at)": f"{made}, 1, 'grading', 'correct', 1.0, 1.0, :course, 'd', :body",
        "events (submission_id, number, name, created_at)": f"{made}, 1, 'graded'",
        "idempotency_keys (course, learner, key, request_digest, submission_id, http_status, "
        "created_at)": f":course, {someone}, 'key' || CAST(i AS text), 'd', {made}, 201",
        "result_revisions (course, learner, quiz, question, submission_id, attempt, points, max_points, is_late, "
        "is_final, revision, position, created_at)": f"{place}, {counts}, i + 1",
        "results (course, learner, quiz, question, submission_id, attempt, points, max_points, is_late, is_final, "
        "revision, first_status, first_option, diagnoses, changes)": f"{place}, {counts}, 'correct', i % 3, '[]', 1",
    }
    counts_of = {"members": learners, "results": learners * questions, "result_revisions": learners * questions}
    at = {"results": ""}
    return [
        (
            counts_of.get(table := into.split()[0], course.submissions),
            f"INSERT INTO {into} SELECT {row}{at.get(table, ', :at')} FROM n",
        )
        for into, row in values.items()
    ]
