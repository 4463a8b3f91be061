"""The links with which learners join courses, and the audit log: the tables and every query on them."""

from collections.abc import Sequence
from datetime import datetime

from sqlalchemy import Index, String, Text, select
from sqlalchemy.orm import Mapped, Session, mapped_column

from grader.store.tables import NAME, Base, now


class CourseLink(Base):
    """The code with which any number of learners join a course. No row: the course is closed to them."""

    __tablename__ = "course_links"

    course: Mapped[str] = mapped_column(String(NAME), primary_key=True)
    code: Mapped[str] = mapped_column(String(40), unique=True)
    created_at: Mapped[datetime] = mapped_column(default=now)


class AuditEntry(Base):
    """What somebody did in a course. The database refuses to change or delete a row."""

    __tablename__ = "audit"
    __table_args__ = (Index("ix_audit_course", "course", "id"),)

    id: Mapped[int] = mapped_column(primary_key=True)
    course: Mapped[str] = mapped_column(String(NAME))
    at: Mapped[datetime] = mapped_column(default=now)
    actor: Mapped[str | None] = mapped_column(String(32))
    """The id of the member who did it; None for the command line."""
    name: Mapped[str] = mapped_column(String(NAME))
    action: Mapped[str] = mapped_column(String(40))
    subject: Mapped[str] = mapped_column(String(NAME))
    """The id or name of what it was done to."""
    detail: Mapped[str] = mapped_column(Text)
    """JSON text."""


def find_link(session: Session, course: str) -> CourseLink | None:
    """The link of a course, if it is open."""
    return session.get(CourseLink, course)


def course_with_code(session: Session, code: str) -> str | None:
    """The course that this code opens."""
    return session.scalar(select(CourseLink.course).where(CourseLink.code == code))


def set_link(session: Session, course: str, code: str) -> None:
    """Opens the course to learners with this code; an earlier code ends."""
    session.merge(CourseLink(course=course, code=code, created_at=now()))


def drop_link(session: Session, course: str) -> bool:
    """Closes the course to learners with a link. False if it was closed before."""
    link = session.get(CourseLink, course)
    if link is not None:
        session.delete(link)
    return link is not None


def audit_page(session: Session, course: str, before: int | None, limit: int) -> Sequence[AuditEntry]:
    """At most `limit` entries of a course, newest first, that are older than the entry `before`."""
    wanted = select(AuditEntry).where(AuditEntry.course == course)
    if before is not None:
        wanted = wanted.where(AuditEntry.id < before)
    return session.scalars(wanted.order_by(AuditEntry.id.desc()).limit(limit)).all()
