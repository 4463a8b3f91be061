"""Ways into a course: single-use links for named members, and a link with a code for everybody who has it."""

import secrets
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta

from sqlalchemy.orm import Session

from grader.courses.people import members
from grader.courses.people.audit import Action, record
from grader.courses.people.identity import CredentialKind, Identity, Role, issue
from grader.courses.people.sign_in import BrowserSession, start_session
from grader.errors import Conflict, Forbidden, NotFound, Unprocessable
from grader.store import courses, credentials
from grader.store.tables import Credential, Member, now

INVITATION = timedelta(days=14)

NAMES_AT_ONCE = 1000
"""Names of one invitation, at most."""

TOLD = 5
"""Names of a list that a refusal tells, at most."""

CLOSED = "This course link is unknown or closed. Ask your instructor for the current one."


@dataclass(frozen=True)
class Invitation:
    """A single-use link for a member: its code, which is shown this once."""

    member: Member
    code: str
    expires_at: datetime


def invite(
    session: Session, by: Identity | None, course: str | None, names: Sequence[str], role: Role | str = Role.STUDENT
) -> list[Invitation]:
    """Makes each name a member with this role, and a link that opens one browser session. A name that is a member
    already gets a new link; its earlier links end. An id stands for its member. Raises Unprocessable, Forbidden,
    Unauthorized, and Conflict where one has another role already, which an invitation never changes, or came in by
    another way."""
    checked = members.check_person_role(role)
    if twice := [name for name, count in Counter(names).items() if count > 1]:
        some = ", ".join(twice[:TOLD]) + (" and others" if len(twice) > TOLD else "")
        raise Unprocessable(f"Given twice: {some}. Two people of one name need different names here.")
    members.require_reach(by, checked)
    invited = [members.get_meant(session, name, checked, course, by=by) for name in names]
    if others := [member for member in invited if member.role != checked]:
        raise Conflict(members.other_roles(others[:TOLD]))
    return [invite_member(session, by, member) for member in invited]


def invite_member(session: Session, by: Identity | None, member: Member) -> Invitation:
    """Makes a link with which the member signs in; earlier ones end. Raises Unprocessable, Forbidden, Unauthorized."""
    members.check_person_role(member.role)
    members.require_credential(session, by)
    members.require_reach(by, member.role)
    session.flush()
    credentials.revoke_all(session, member.id, now(), [CredentialKind.SIGN_IN])
    code = issue(session, CredentialKind.SIGN_IN, member, INVITATION, by=by)
    record(session, by, member.course, Action.INVITED, member.name, member=member.id, role=member.role)
    return Invitation(member, code, now() + INVITATION)


def list_pending(session: Session, course: str) -> Sequence[Credential]:
    """Returns the links of a course that were neither used nor revoked, newest first."""
    return credentials.list_alive(session, course, CredentialKind.SIGN_IN, now())


def revoke(session: Session, by: Identity, invitation_id: str) -> None:
    """Ends a link. Raises NotFound if it is not one of the course, or has ended; Forbidden, Unauthorized."""
    credential = credentials.find(session, invitation_id, CredentialKind.SIGN_IN, now())
    if credential is None or credential.course != by.course:
        raise NotFound("There is no such invitation.")
    members.require_credential(session, by)
    members.require_reach(by, credential.role)
    credentials.revoke(session, credential.id, now())
    record(session, by, by.course, Action.INVITATION_REVOKED, credential.user, member=credential.member)


def rotate_link(session: Session, by: Identity) -> str:
    """Opens the course to all who have the new code, which is returned; an earlier code ends. Raises Unauthorized."""
    members.require_credential(session, by)
    code = secrets.token_urlsafe(16)
    courses.set_link(session, by.course, code)
    record(session, by, by.course, Action.LINK_ROTATED)
    return code


def close_link(session: Session, by: Identity) -> None:
    """Ends the course link; those who joined stay."""
    if courses.drop_link(session, by.course):
        record(session, by, by.course, Action.LINK_CLOSED)


def join(session: Session, code: str, name: str) -> BrowserSession:
    """Makes a new learner of the course with this code, under a name of their own choice. The name is a label and gives
    no access to the work of others who bear it. Raises Forbidden, Unprocessable."""
    course = courses.course_with_code(session, code)
    if course is None:
        raise Forbidden(CLOSED)
    opened = start_session(session, members.make_unnamed(session, course, name))
    record(session, opened.identity, course, Action.JOINED, opened.identity.user)
    return opened
