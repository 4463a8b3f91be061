"""Learning platforms: who registers and approves them, how their courses are linked with ours, who their users are."""

import hashlib
import json
from collections.abc import Collection
from dataclasses import dataclass

from sqlalchemy import exists, select
from sqlalchemy.orm import Session

from grader.courses.people import members
from grader.courses.people.audit import Action, record
from grader.courses.people.identity import DEFAULT_COURSE, Identity, Role, check_name
from grader.errors import Conflict, Forbidden, NotFound, Unprocessable
from grader.store import people as stored_people
from grader.store import platforms
from grader.store.platforms import ID, Context, PlatformRow
from grader.store.tables import Member, now

ADMINISTRATOR = "The platforms belong to the installation: an instructor of the course `default` administers them."

NAMELESS = "learner"
"""The name of a user whose name a platform does not tell."""

NEW_COURSES = "lti-courses"
"""The lock under which a course is looked for and made: two who name the same new one do not both make it."""

PLATFORM = "learning platform"
"""Who changes a role in the audit log, where a platform's course has given it."""


@dataclass(frozen=True)
class Registration:
    """What a platform's administrator gives, or a dynamic registration finds out."""

    name: str
    issuer: str
    client_id: str
    login_url: str
    token_url: str
    keys_url: str
    token_audience: str = ""
    origins: tuple[str, ...] = ()


@dataclass(frozen=True)
class Person:
    """A user of a platform: `subject` identifies them for the issuer, and the platform's course gives the role. `email`
    is the address on the platform's roster, if it has one; it is shown, and never identifies a member."""

    issuer: str
    subject: str
    name: str
    role: Role
    email: str | None = None


def require_administrator(by: Identity, why: str = ADMINISTRATOR) -> None:
    """Raises Forbidden, which says `why`, unless this is an instructor of the course `default`, who administer the
    installation."""
    by.require(Role.INSTRUCTOR)
    if by.course != DEFAULT_COURSE:
        raise Forbidden(why)


def add(session: Session, by: Identity | None, given: Registration, deployment_id: str | None = None) -> PlatformRow:
    """Registers a platform, with its first deployment if that is known. Nobody comes from it until it is approved.
    Raises Unprocessable, and Conflict if the issuer has a platform with this client id."""
    name = check_name("platform", given.name)
    for field, value in (("issuer", given.issuer), ("client id", given.client_id)):
        if not 1 <= len(value) <= ID or not value.isprintable():
            raise Unprocessable(f"The {field} of a platform has 1 to {ID} printable characters.")
    if platforms.find_registered(session, given.issuer, given.client_id):
        raise Conflict("This issuer is registered with this client id already: remove that platform first.")
    row = PlatformRow(**vars(given) | {"name": name, "origins": json.dumps(given.origins)})
    session.add(row)
    session.flush()
    if deployment_id:
        platforms.note_deployment(session, row.id, deployment_id)
    record(session, by, DEFAULT_COURSE, Action.PLATFORM_ADDED, name, platform=row.id)
    return row


def approve(session: Session, by: Identity | None, platform_id: int, deployment_id: str | None = None) -> PlatformRow:
    """Approves a platform, and one deployment of it or all that wait. Raises NotFound."""
    row = get_platform(session, platform_id)
    if deployment_id is not None and platforms.note_deployment(session, row.id, deployment_id) is None:
        raise Conflict("Too many deployments wait for approval: approve those, or remove the platform.")
    row.approved_at = row.approved_at or now()
    approved = platforms.approve_deployments(session, row.id, deployment_id)
    record(session, by, DEFAULT_COURSE, Action.PLATFORM_APPROVED, row.name, platform=row.id, deployments=approved)
    return row


def remove(session: Session, by: Identity | None, platform_id: int) -> None:
    """Removes a platform with all that its launches told. Members and answers stay. Raises NotFound."""
    row = get_platform(session, platform_id)
    record(session, by, DEFAULT_COURSE, Action.PLATFORM_REMOVED, row.name, platform=row.id)
    platforms.remove(session, row)


def get_platform(session: Session, platform_id: int) -> PlatformRow:
    """Returns the platform with this id. Raises NotFound."""
    row = platforms.get(session, platform_id)
    if row is None:
        raise NotFound("There is no such platform.")
    return row


def course_exists(session: Session, course: str, known: Collection[str] = ()) -> bool:
    """Says whether somebody has this course already: a folder of its own, a member, or a link with a platform."""
    if course == DEFAULT_COURSE or course in known:
        return True
    has_member, is_linked = exists().where(Member.course == course), exists().where(Context.course == course)
    return bool(session.scalar(select(has_member | is_linked)))


def ask_for(session: Session, context_id: int, course: str, by: str, known: Collection[str] = ()) -> bool:
    """Links a platform's course with a new course here, as an instructor of it asks. Returns whether it is linked. A
    course that exists has instructors, who approve first. Raises NotFound, Unprocessable, and Conflict if it is linked
    already."""
    context, course = get_context(session, context_id), check_name("course", course.strip())
    if context.course is not None:
        raise Conflict("This course is linked already. Start again from your learning platform.")
    is_new = not course_exists(session, course, known)
    context.wanted, context.wanted_by = course, by
    record(session, None, course, Action.CONTEXT_WANTED, context.title, unsigned=by, context=context.id)
    if is_new:
        link(session, None, context.id, course)
    return is_new


def link(session: Session, by: Identity | None, context_id: int, course: str) -> Context:
    """Links a platform's course with a course here: who teaches there is an instructor here. Raises NotFound."""
    context, course = get_context(session, context_id), check_name("course", course)
    if context.course not in (None, course):
        raise Conflict(f"This course is linked with {context.course!r}: unlink it first.")
    context.course, context.wanted, context.wanted_by = course, None, None
    record(session, by, course, Action.CONTEXT_LINKED, context.title, context=context.id)
    return context


def unlink(session: Session, by: Identity | None, context_id: int) -> None:
    """Ends the link of a platform's course, or declines it. Raises NotFound."""
    context = get_context(session, context_id)
    course = context.course or context.wanted or DEFAULT_COURSE
    platforms.unlink(session, context)
    record(session, by, course, Action.CONTEXT_UNLINKED, context.title, context=context.id)


def get_own_context(session: Session, by: Identity, context_id: int) -> Context:
    """Returns a platform's course that is linked with the instructor's, or asks to be. Raises NotFound."""
    context = platforms.context_by_id(session, context_id)
    if context is None or by.course not in (context.course, context.wanted if context.course is None else None):
        raise NotFound("There is no such course of a platform.")
    return context


def get_context(session: Session, context_id: int) -> Context:
    """Returns the platform's course with this id of ours. Raises NotFound."""
    context = platforms.context_by_id(session, context_id)
    if context is None:
        raise NotFound("There is no such course of a platform.")
    return context


def get_member(session: Session, context: Context, person: Person) -> Member:
    """Returns the member who a platform's user is in the linked course; made at the first call. The platform gives the
    role, and the name unless an instructor has set it. A subject belongs to one person of its issuer. Raises
    Forbidden if an instructor has removed the member."""
    assert context.course is not None
    digest = hashlib.sha256(f"{person.issuer}\n{person.subject}".encode()).hexdigest()
    account = f"lti:{digest}"
    known = stored_people.find_with_account(session, context.course, account)
    if known is not None and known.removed_at is not None:
        raise Forbidden("You were removed from this course. Ask its instructor.")
    member = known or members.get_with_account(session, account, person.name, person.role, context.course)
    members.give_role(session, None, member, person.role, unsigned=PLATFORM)
    if person.email is not None:
        member.email = person.email
    if person.name != NAMELESS:
        members.follow_name(session, member, person.name)
    platforms.enrol(session, context.id, person.subject, member.id)
    return member
