"""Every query on saved comments."""

from collections.abc import Sequence

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from grader.store.tables import SavedComment


def of_question(session: Session, course: str, quiz: str, question: str) -> Sequence[SavedComment]:
    """The comments saved for a question, oldest first."""
    here = (SavedComment.course == course, SavedComment.quiz == quiz, SavedComment.question == question)
    return session.scalars(select(SavedComment).where(*here).order_by(SavedComment.id)).all()


def count(session: Session, course: str, quiz: str, question: str) -> int:
    """How many comments are saved for a question."""
    here = (SavedComment.course == course, SavedComment.quiz == quiz, SavedComment.question == question)
    return session.scalar(select(func.count()).select_from(SavedComment).where(*here)) or 0


def get(session: Session, comment_id: str, course: str) -> SavedComment | None:
    """The comment with this id, if the course has it."""
    comment = session.get(SavedComment, comment_id)
    return comment if comment is not None and comment.course == course else None
