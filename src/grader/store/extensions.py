"""Every query on extensions and on published feedback."""

from collections.abc import Sequence
from datetime import datetime

from sqlalchemy import delete, select
from sqlalchemy.orm import Session

from grader.domain.policy import Extension
from grader.store.engine.names import Folded
from grader.store.tables import ExtensionRow, Member, Publication, now

Key = tuple[str, str, str]
"""Course, quiz and learner: the primary key."""


def list_of_learner(session: Session, course: str, learner: str, quizzes: Sequence[str]) -> dict[str, Extension]:
    """The extensions of a learner in some quizzes, by quiz."""
    theirs = select(ExtensionRow).where(ExtensionRow.course == course, ExtensionRow.learner == learner)
    return {row.quiz: read_extension(row) for row in session.scalars(theirs.where(ExtensionRow.quiz.in_(quizzes)))}


def list_of_quiz(session: Session, course: str, quiz: str) -> list[tuple[ExtensionRow, str]]:
    """Every extension in a quiz with the learner's name, in the order of names."""
    rows = select(ExtensionRow, Member.name).join(Member, Member.id == ExtensionRow.learner)
    here = rows.where(ExtensionRow.course == course, ExtensionRow.quiz == quiz)
    return [(row, name) for row, name in session.execute(here.order_by(Folded(Member.name), Member.id))]


def put(session: Session, key: Key, granted: Extension, by: str) -> None:
    """Replaces the extension of (course, quiz, learner); one that gives nothing is deleted."""
    course, quiz, learner = key
    row = session.get(ExtensionRow, key)
    if granted == Extension():
        if row is not None:
            session.delete(row)
        return
    if row is None:
        row = ExtensionRow(course=course, quiz=quiz, learner=learner)
        session.add(row)
    row.due, row.until, row.attempts, row.granted_by, row.created_at = (*granted.model_dump().values(), by, now())


def read_extension(row: ExtensionRow) -> Extension:
    """The extension that a row holds."""
    return Extension(due=row.due, until=row.until, attempts=row.attempts)


def find_published(session: Session, course: str, quizzes: Sequence[str]) -> dict[str, datetime]:
    """When the feedback of quizzes was published, by quiz; unpublished ones are left out."""
    rows = select(Publication).where(Publication.course == course, Publication.quiz.in_(quizzes))
    return {row.quiz: row.published_at for row in session.scalars(rows)}


def publish(session: Session, course: str, quiz: str, by: str) -> None:
    """Publishes the feedback of a quiz; the first time counts."""
    if session.get(Publication, (course, quiz)) is None:
        session.add(Publication(course=course, quiz=quiz, published_by=by, published_at=now()))


def withdraw(session: Session, course: str, quiz: str) -> None:
    """Withholds the feedback of a quiz again."""
    session.execute(delete(Publication).where(Publication.course == course, Publication.quiz == quiz))
