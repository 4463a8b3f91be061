"""What is stored of learners at questions: what new answers to them are decided and counted by."""

from collections.abc import Collection
from dataclasses import dataclass, field
from datetime import datetime
from typing import NamedTuple

from sqlalchemy import and_, case, func, select
from sqlalchemy.orm import Session

from grader.domain.policy import Extension, Progress
from grader.domain.verdict import Status
from grader.store.engine.keys import read_by_keys
from grader.store.results import Columns, LearnerAt
from grader.store.submissions import NEWEST
from grader.store.tables import Result, Submission, VerdictRow


class SourceAttempt(NamedTuple):
    """The attempt that a result comes from, with the points of its newest verdict."""

    id: str
    attempt: int
    created_at: datetime
    outcome: str | None
    points: float | None


@dataclass
class QuestionState:
    """What is stored of a learner at a question."""

    progress: Progress = field(default_factory=Progress)
    newest_id: str = ""
    """The id of the newest attempt; empty without one."""
    result: Columns | None = None
    """The columns of the result."""
    source: SourceAttempt | None = None
    extension: Extension | None = None
    """Not read by `read_states`."""


AT_RESULT = (Result.course, Result.learner, Result.quiz, Result.question)
AT_SUBMISSION = (Submission.course, Submission.learner, Submission.quiz, Submission.question)

ATTEMPTS = (
    select(
        *AT_SUBMISSION,
        func.count(),
        func.count(case((Submission.outcome.is_(None), 1))),
        func.count(case((Submission.outcome == Status.CORRECT.value, 1))),
        func.max(Submission.id),
    )
    .where(Submission.uses_attempt)
    .group_by(*AT_SUBMISSION)
)
RESULT = Result.__table__
RESULTS = (
    select(*RESULT.columns, Submission.id, Submission.attempt, Submission.created_at, Submission.outcome,
           VerdictRow.points)
    .select_from(RESULT)
    .outerjoin(Submission, and_(Submission.id == Result.submission_id, Submission.uses_attempt))
    .outerjoin(VerdictRow, NEWEST)
)  # fmt: skip


def read_states(session: Session, places: Collection[LearnerAt]) -> dict[LearnerAt, QuestionState]:
    """The states of different learners at questions; in two queries, however many they are."""
    states = {place: QuestionState() for place in places}
    for *place, made, pending, correct, newest in read_by_keys(session, ATTEMPTS, AT_SUBMISSION, states):
        state = states[LearnerAt(*place)]
        state.progress, state.newest_id = Progress(made, pending, bool(correct)), newest
    names = RESULT.columns.keys()
    for row in read_by_keys(session, RESULTS, AT_RESULT, states):
        columns, source = dict(zip(names, row, strict=False)), SourceAttempt(*row[len(names) :])
        state = states[LearnerAt(*(columns[name] for name in LearnerAt._fields))]
        state.result = columns
        if source.id is not None:
            state.source = source
    return states
