"""The statistics of a quiz from its stored results, for the API and for pages."""

import json
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from grader.courses.statistics import QuestionStatistics, Row, statistics_of
from grader.domain.quiz import NumericQuestion, Quiz
from grader.domain.verdict import Status
from grader.store.results import LearnerAt


@dataclass(frozen=True)
class QuizStatistics:
    """The questions of a quiz that have answers, in the order of the quiz, and the number of learners."""

    learners: int
    questions: tuple[QuestionStatistics, ...]


def measured(
    quiz: Quiz, found: Iterable[Any], course: str, without: Collection[str], unseen: Collection[LearnerAt]
) -> QuizStatistics:
    """The statistics of a quiz from the rows of `results.of_quiz`.

    Learners of `without` are left out, such as instructors who try questions, and so are `unseen` results.
    """
    order = {question.id: place for place, question in enumerate(quiz.questions)}
    tolerances = {one.id: one.tolerance for one in quiz.questions if isinstance(one, NumericQuestion)}
    rows = [
        row_of(row)
        for row in found
        if row.learner not in without
        and row.question in order
        and not (unseen and LearnerAt(course, row.learner, quiz.id, row.question) in unseen)
    ]
    questions = sorted(statistics_of(rows, tolerances), key=lambda one: order[one.question])
    return QuizStatistics(len({row.learner for row in rows}), tuple(questions))


def row_of(row: Any) -> Row:
    """A stored result as statistics read it."""
    return Row(
        row.learner,
        row.question,
        row.points,
        row.max_points,
        Status(row.first_status),
        row.first_option,
        row.first_value,
        diagnoses_of(row.diagnoses),
    )


@lru_cache(maxsize=4096)
def diagnoses_of(text: str) -> tuple[str, ...]:
    """The diagnoses that a result lists. Learners share them."""
    return tuple(json.loads(text))
