"""Erases a learner: the points stay for statistics, without the name."""

from sqlalchemy.orm import Session

from grader.courses.people.audit import Action, record
from grader.courses.people.external import External
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
    """Returns the member of this name or id, of the default course without another; a removed one too. A name may be
    NAMESPACE:ID of another system, as members without a name are shown. Raises NotFound."""
    course = course or DEFAULT_COURSE
    member = session.get(Member, member_id) if member_id else find_account(session, course, user or "")
    if member is None or member.course != course:
        raise NotFound(
            f"There is no such member of the course {course}: name another with --course. --user takes a name that an "
            "instructor or operator gave, or NAMESPACE:ID of another system. Everybody is found by --id of the member, "
            "and those who chose their name themselves, or came from a learning platform, by it alone."
        )
    return member


def find_account(session: Session, course: str, user: str) -> Member | None:
    """Returns the member who was given this name, else the one whom another system knows as NAMESPACE:ID."""
    namespace, _, external_id = user.partition(":")  # no namespace has a colon
    return people.find_with_account(session, course, f"name:{user}") or people.find_with_account(
        session, course, External(namespace, external_id).account
    )
