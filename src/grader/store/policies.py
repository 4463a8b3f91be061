"""What courses have changed in the policies of quizzes, and every query on it."""

from datetime import datetime

from sqlalchemy import String, Text, delete, select
from sqlalchemy.orm import Mapped, Session, mapped_column

from grader.store.tables import NAME, Base, now


class PolicyChange(Base):
    """What a course has in place of values of a quiz's policy. No row: the policy of the content is in force."""

    __tablename__ = "policy_changes"

    course: Mapped[str] = mapped_column(String(NAME), primary_key=True)
    quiz: Mapped[str] = mapped_column(String(64), primary_key=True)
    changes: Mapped[str] = mapped_column(Text)
    """The keys of `Policy` that the course has set, with their values, as a JSON object."""
    changed_by: Mapped[str] = mapped_column(String(NAME))
    changed_at: Mapped[datetime] = mapped_column(default=now)


def read_of_course(session: Session, course: str) -> dict[str, str]:
    """The changes of a course as JSON text, by quiz; quizzes without any are left out."""
    rows = select(PolicyChange.quiz, PolicyChange.changes).where(PolicyChange.course == course)
    return {row.quiz: row.changes for row in session.execute(rows)}


def read_of_quiz(session: Session, course: str, quiz: str) -> str | None:
    """The changes at one quiz as JSON text; None without any."""
    return session.scalar(select(PolicyChange.changes).where(PolicyChange.course == course, PolicyChange.quiz == quiz))


def find(session: Session, course: str, quiz: str) -> PolicyChange | None:
    """The changes at one quiz, with who made them and when."""
    return session.get(PolicyChange, (course, quiz), populate_existing=True)


def put(session: Session, course: str, quiz: str, changes: str | None, by: str) -> None:
    """Replaces the changes at a quiz; None takes them back."""
    if changes is None:
        here = PolicyChange.course == course, PolicyChange.quiz == quiz
        session.execute(delete(PolicyChange).where(*here))
    else:
        session.merge(PolicyChange(course=course, quiz=quiz, changes=changes, changed_by=by, changed_at=now()))
