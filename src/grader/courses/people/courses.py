"""The courses that one person teaches: they are made, listed, and entered from one another.

A member belongs to one course. Whoever makes a course becomes a new member of it, whose `home` is the member who made
it. From a session of the home one enters the other courses, and returns. The way never leads from a member to the home
of that member: other instructors of a course can make sign-in links for its members, and would come along. A session
that was opened so names the one that it was opened from, and ends with it at the latest.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from sqlalchemy.orm import Session

from grader.courses.people import members
from grader.courses.people.audit import Action, record
from grader.courses.people.identity import CredentialKind, Identity, Role, check_name, find
from grader.courses.people.platforms import NEW_COURSES, course_exists, require_administrator
from grader.courses.people.sign_in import SPENT, BrowserSession, start_session
from grader.errors import Conflict, Forbidden, NotFound, Unauthorized
from grader.store import credentials, people
from grader.store.engine.database import Database
from grader.store.tables import Credential, Member, now

MAKER = "Courses belong to the installation: an instructor of the course `default` makes new ones."

ELSEWHERE = "another course"
"""How somebody signed in who entered a course from another one, in the audit log."""


@dataclass(frozen=True)
class TaughtCourse:
    """A course that a person teaches: who they are in it, how many learners it has, whether they are in it now."""

    course: str
    member: Member
    learners: int
    is_current: bool


def list_taught(session: Session, who: Identity) -> list[TaughtCourse]:
    """Returns the courses in which this person is an instructor: the one that they came from first, then by name."""
    home = get_home(session, who)
    taught = [member for member in (home, *people.list_with_home(session, home.id)) if is_instructor(member)]
    learners = people.count_learners(session, [member.course for member in taught])
    return [
        TaughtCourse(member.course, member, learners.get(member.course, 0), member.id == who.id) for member in taught
    ]


def is_instructor(member: Member) -> bool:
    """Says whether somebody is a member still, and an instructor."""
    return member.removed_at is None and member.role == Role.INSTRUCTOR


def get_home(session: Session, who: Identity) -> Member:
    """Returns the member in whose course this session, or the one that it was opened from, began."""
    presented = session.get(Credential, who.credential)
    began = None if presented is None or presented.home is None else session.get(Credential, presented.home)
    return session.get_one(Member, who.id if began is None else began.member)


def make_course(database: Database, session: Session, by: Identity, name: str) -> Member:
    """Makes a course, whose instructor the caller becomes, and returns who they are in it. Raises Forbidden unless they
    administer the installation; Unprocessable, Unauthorized, and Conflict if somebody has the course already."""
    require_administrator(by, MAKER)
    members.require_credential(session, by)
    course = check_name("course", name.strip())
    database.lock(session, NEW_COURSES)
    if course_exists(session, course):
        raise Conflict(f"There is a course {course!r} already: its instructors can invite you, on their page People.")
    home = get_home(session, by)
    member = members.get_named(session, by.user, Role.INSTRUCTOR, course)
    member.home = home.id
    session.flush()
    record(session, by, by.course, Action.COURSE_MADE, course)
    record(session, Identity(member.id, member.name, Role.INSTRUCTOR, course), course, Action.COURSE_MADE, course)
    return member


def list_unused(session: Session, folders: Sequence[str]) -> list[str]:
    """Returns the courses with a content folder of their own that nobody has yet."""
    return [course for course in folders if course and not course_exists(session, course)]


def enter_course(session: Session, who: Identity, member_id: str) -> BrowserSession:
    """Opens a session in another course that this person teaches; `who` is left where it is a session of a course that
    was entered. Raises NotFound, Unauthorized."""
    members.require_credential(session, who)
    chosen = [course.member for course in list_taught(session, who) if course.member.id == member_id]
    if not chosen or not who.by_cookie:
        raise NotFound("You teach no such course, or came to this one by a link of its own: sign in there.")
    presented = session.get_one(Credential, who.credential)
    began = presented if presented.home is None else session.get_one(Credential, presented.home)
    returns = began.member == member_id
    opened = start_session(session, chosen[0], who.platform, home=None if returns else began.id, until=began.expires_at)
    if returns or presented.id != began.id:
        credentials.revoke(session, began.id if returns else presented.id, now())
    record(session, opened.identity, opened.identity.course, Action.SIGNED_IN, opened.identity.user, by=ELSEWHERE)
    return opened


def add_course(session: Session, who: Identity, code: str) -> BrowserSession:
    """Uses a sign-in link of another course, and adds that course to those which this person enters from their own.
    Raises Unauthorized, Forbidden unless they are an instructor in both, and Conflict for a link of the own course."""
    members.require_credential(session, who)
    link = find(session, CredentialKind.SIGN_IN, code)
    if link is None:
        raise Unauthorized(SPENT)
    home, member = get_home(session, who), session.get_one(Member, link.member)
    if not who.is_instructor or not is_instructor(member):
        raise Forbidden("Only courses in which you are an instructor are added to yours.")
    if member.course in (home.course, who.course):
        raise Conflict("This link leads to the course that you are in: sign in with it as it is.")
    if not credentials.revoke(session, link.id, now()):
        raise Unauthorized(SPENT)
    member.home = home.id
    session.flush()
    return enter_course(session, who, member.id)
