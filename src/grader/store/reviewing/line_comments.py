"""What instructors write to lines of scripts: the table and every query on it. It changes no verdict and no points."""

from collections.abc import Iterable, Sequence
from datetime import datetime
from typing import NamedTuple

from sqlalchemy import ForeignKey, Index, String, Text, func, select
from sqlalchemy.orm import Mapped, Session, mapped_column

from grader.store.engine.ids import make_id
from grader.store.tables import NAME, Base, Submission, now


class LineComment(Base):
    """A comment on a line of a script that was handed in, or on all of it."""

    __tablename__ = "line_comments"
    __table_args__ = (Index("ix_line_comments_submission", "submission_id", "id"),)

    id: Mapped[str] = mapped_column(String(32), primary_key=True, default=make_id)
    course: Mapped[str] = mapped_column(String(NAME))
    submission_id: Mapped[str] = mapped_column(ForeignKey("submissions.id"))
    line: Mapped[int | None]
    """From 1; None for the whole script."""
    text: Mapped[str] = mapped_column(Text)
    author: Mapped[str] = mapped_column(String(32))
    """The id of the instructor who wrote it."""
    name: Mapped[str] = mapped_column(String(NAME))
    """Their name."""
    created_at: Mapped[datetime] = mapped_column(default=now)


class TriedCopy(Base):
    """A changed copy of a learner's script that an instructor ran: a submission of the instructor's own."""

    __tablename__ = "tried_copies"
    __table_args__ = (Index("ix_tried_copies_original", "original"),)

    submission_id: Mapped[str] = mapped_column(ForeignKey("submissions.id"), primary_key=True)
    original: Mapped[str] = mapped_column(ForeignKey("submissions.id"))
    """The submission that was copied."""


BY_LINE = (LineComment.line.nulls_first(), LineComment.id)
"""The order of comments: those on the whole script first, then line by line, the oldest first."""


def on_submissions(session: Session, ids: Iterable[str]) -> dict[str, list[LineComment]]:
    """The comments on submissions, by submission, each in the order BY_LINE."""
    wanted = select(LineComment).where(LineComment.submission_id.in_(list(ids)))
    by_submission: dict[str, list[LineComment]] = {}
    for comment in session.scalars(wanted.order_by(*BY_LINE)):
        by_submission.setdefault(comment.submission_id, []).append(comment)
    return by_submission


class CommentedAttempt(NamedTuple):
    """An attempt with comments, and how many."""

    quiz: str
    question: str
    submission: str
    at: datetime
    comments: int


def list_of_learner(session: Session, course: str, learner: str) -> Sequence[CommentedAttempt]:
    """The attempts of a learner that have comments, the newest first."""
    columns = (Submission.quiz, Submission.question, Submission.id, Submission.created_at)
    counted = select(*columns, func.count()).join(LineComment, LineComment.submission_id == Submission.id)
    theirs = counted.where(Submission.course == course, Submission.learner == learner).group_by(*columns)
    return [CommentedAttempt(*row) for row in session.execute(theirs.order_by(Submission.id.desc()))]


def find(session: Session, comment_id: str, course: str) -> LineComment | None:
    """The comment of this id in a course."""
    return session.scalar(select(LineComment).where(LineComment.id == comment_id, LineComment.course == course))


def list_copies(session: Session, original: str, learner: str) -> list[str]:
    """The ids of the copies of a submission that a member ran, the newest first."""
    wanted = select(TriedCopy.submission_id).join(Submission, Submission.id == TriedCopy.submission_id)
    mine = wanted.where(TriedCopy.original == original, Submission.learner == learner)
    return list(session.scalars(mine.order_by(TriedCopy.submission_id.desc())))
