"""Erases a learner: the points stay for statistics, without the name."""

from sqlalchemy.orm import Session

from grader.courses.people.audit import Action, record
from grader.courses.people.identity import DEFAULT_COURSE, Identity, Role
from grader.errors import Conflict, NotFound, Unprocessable
from grader.store import people
from grader.store.engine.database import Database
from grader.store.tables import Member
from grader.store.upkeep import erasure


def erase_learner(
    database: Database, session: Session, *, user: str | None = None, member_id: str | None = None,
    course: str | None = None, by: Identity | None = None,
) -> str:  # fmt: skip
    """Erases the learner with this name, given by an instructor or operator, or with this id. Returns the new name. It
    cannot be undone. Raises NotFound, Unprocessable for somebody who is no student, and Conflict while an answer of the
    learner waits for the grader."""
    member = find_member(session, course, user, member_id)
    if member.role != Role.STUDENT:
        raise Unprocessable(f"{member.name} is no student: change the role first, or remove the member.")
    database.lock_learner(session, member.course, member.id)
    if waiting := erasure.count_ungraded(session, member):
        raise Conflict(f"{waiting} of the learner's answers wait for the grader: try again when they are graded.")
    name = erasure.erase(session, member)
    record(session, by, member.course, Action.MEMBER_ERASED, name, member=member.id)
    return name


def find_member(session: Session, course: str | None, user: str | None, member_id: str | None) -> Member:
    """Returns the member of this name or id, of the default course without another; a removed one too. Raises
    NotFound."""
    course = course or DEFAULT_COURSE
    member = session.get(Member, member_id) if member_id else people.find_with_account(session, course, f"name:{user}")
    if member is None or member.course != course:
        raise NotFound(
            f"There is no such member of the course {course}: name another with --course. Those who chose their name "
            "themselves are found by --id alone."
        )
    return member
