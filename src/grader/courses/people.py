"""The members of a course: named by an instructor, or come by themselves."""

import secrets

from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import Session

from grader.courses.audit import Action, record
from grader.errors import Conflict, NotFound, Unprocessable
from grader.identity import DEFAULT_COURSE, Identity, Kind, Role, checked_name, checked_role
from grader.store import credentials, people
from grader.store.tables import Member, new_member_id, now


def named(session: Session, name: str, role: Role, course: str | None = None) -> Member:
    """The member of this name that an instructor or operator made; made now at the first call. Raises Unprocessable.

    Members who chose their name themselves are never found by it.
    """
    name = checked_name("user", name)
    course = checked_name("course", DEFAULT_COURSE if course is None else course)
    return with_account(session, f"name:{name}", name, role, course)


def known(session: Session, name: str, course: str) -> bool:
    """Whether an instructor or operator has made a member of this name, who is still there. Raises Unprocessable."""
    found = people.with_account(session, course, f"name:{checked_name('user', name)}")
    return found is not None and found.removed_at is None


def with_account(session: Session, account: str, name: str, role: Role, course: str) -> Member:
    """The member with this account; made now with the name and role at the first call."""
    if found := people.with_account(session, course, account):
        found.removed_at = None
        return found
    member = Member(id=new_member_id(), course=course, name=name, account=account, role=role.value)
    try:
        with session.begin_nested():
            session.add(member)
    except IntegrityError:  # another process has just made it
        found = people.with_account(session, course, account)
        assert found is not None
        return found
    return member


def unnamed(session: Session, course: str = DEFAULT_COURSE, name: str | None = None) -> Member:
    """Makes a learner whose browser session is the only way back; without a name, one is made up. Raises Unprocessable.

    The name is a label: others may bear it too.
    """
    chosen = f"learner-{secrets.token_hex(3)}" if name is None else checked_name("learner", name.strip())
    member = Member(id=new_member_id(), course=course, name=chosen, role=Role.STUDENT.value)
    session.add(member)
    session.flush()
    return member


def remove(session: Session, by: Identity, member_id: str) -> None:
    """Ends a member's tokens, sessions and links; the answers stay. Raises NotFound, Conflict."""
    member = other(session, by, member_id)
    credentials.revoke_all(session, member.id, now())
    member.removed_at = now()
    record(session, by, by.course, Action.MEMBER_REMOVED, member.name, member=member.id)


def change_role(session: Session, by: Identity, member_id: str, role: str) -> Member:
    """Gives a member another role, from their next sign-in on: sessions and links end, tokens keep the role they have.

    Raises NotFound, Conflict, Unprocessable.
    """
    member = other(session, by, member_id)
    member.role = checked_person(role).value
    credentials.revoke_all(session, member.id, now(), [Kind.SESSION, Kind.SIGN_IN])
    record(session, by, by.course, Action.ROLE_CHANGED, member.name, member=member.id, role=role)
    return member


def checked_person(role: str) -> Role:
    """The role of this name, if a person may have it who signs in with a link. Raises Unprocessable."""
    checked = checked_role(role)
    if checked is Role.SERVICE:
        raise Unprocessable("A service uses a token, not a link: grader token create --role service.")
    return checked


def other(session: Session, by: Identity, member_id: str) -> Member:
    """A member of the course other than `by`. Raises NotFound, Conflict."""
    member = people.get(session, member_id, by.course)
    if member is None:
        raise NotFound("There is no such member.")
    if member.id == by.id:
        raise Conflict("Ask another instructor to change your own membership.")
    return member
