"""The members of a course: named by an instructor, or come by themselves; who may act on whom, and who has which role.
`give_role` is the only function that changes a role, whatever asks for it: pages, API, commands, rosters, platforms."""

import secrets
from collections.abc import Sequence

from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import Session

from grader.courses.people.audit import COMMAND_LINE, Action, record
from grader.courses.people.identity import (
    DEFAULT_COURSE,
    FAILED,
    Identity,
    Role,
    check_name,
    check_role,
    still_holds,
)
from grader.errors import Conflict, Forbidden, NotFound, Unauthorized, Unprocessable
from grader.store import credentials, people, results
from grader.store.engine.ids import make_member_id
from grader.store.tables import Member, now

STUDENTS_ALONE = "A restricted token and a service reach students alone: this takes an instructor without restriction."


def is_restricted(by: Identity | None) -> bool:
    """Says whether the caller reaches students alone: a token with scopes, or a service. `None` is the command line."""
    return by is not None and (by.scopes is not None or not by.is_instructor)


def require_reach(by: Identity | None, role: str) -> None:
    """Raises Forbidden unless the caller may act on somebody of this role."""
    if role != Role.STUDENT and is_restricted(by):
        raise Forbidden(STUDENTS_ALONE)


def require_credential(session: Session, by: Identity | None) -> None:
    """Raises Unauthorized if the caller's credential has ended between the request and the change that it asks for."""
    if by is not None and not still_holds(session, by):
        raise Unauthorized(FAILED)


def get_named(
    session: Session, name: str, role: Role, course: str | None = None, *, by: Identity | None = None
) -> Member:
    """Returns the member of this name that an instructor or operator made; made now, with the role, at the first call.
    Members who chose their name themselves are never found by it. One who was removed is a member again. Raises
    Unprocessable, and Forbidden where `by` may not act on them."""
    name = check_name("user", name)
    course = check_name("course", DEFAULT_COURSE if course is None else course)
    if is_restricted(by):
        earlier = people.find_with_account(session, course, f"name:{name}")
        require_reach(by, role if earlier is None else earlier.role)
        if earlier is not None and earlier.removed_at is not None:
            raise Forbidden(f"{name} was removed: only an instructor without restriction brings members back.")
    return get_with_account(session, f"name:{name}", name, role, course)


def find_named(session: Session, name: str, course: str) -> Member:
    """Returns the only member who bears this name, however they came to the course; the name may also be an id. Raises
    NotFound, and Unprocessable where several bear it."""
    bearers = people.list_bearers(session, course, check_name("user", name))
    if not bearers and (member := people.get(session, name, course)):
        return member
    if not bearers:
        raise NotFound(f"Nobody in the course {course!r} has the name {name!r}: see the page People, or GET /members.")
    if len(bearers) > 1:
        ids = ", ".join(member.id for member in bearers)
        raise Unprocessable(f"{len(bearers)} members have the name {name!r}: give an id in its place, one of {ids}.")
    return bearers[0]


def other_roles(some: Sequence[Member]) -> str:
    """Says why these members get no link and no token for another role than theirs."""
    each = ", ".join(f"{member.name} ({member.role})" for member in some)
    return (
        f"In the course already with another role: {each}. Links and tokens change no role. Ask for the role that they "
        "have, or change it first: on the page People, by PATCH /api/v1/members/{id}, or by `grader roster import`."
    )


def get_meant(
    session: Session, name: str, role: Role, course: str | None = None, *, by: Identity | None = None
) -> Member:
    """Returns the member whom a typed name or id means; made now, with the role, where the name is new. Raises
    Unprocessable, Conflict as `find_meant`, and Forbidden where `by` may not act on them."""
    member = find_meant(session, name, DEFAULT_COURSE if course is None else course)
    if member is None:
        return get_named(session, name, role, course, by=by)
    require_reach(by, member.role)
    return member


def find_meant(session: Session, name: str, course: str) -> Member | None:
    """Returns the member whom an instructor or operator made under this name, or whose id it is; None where the name is
    new, or only learners bear it who chose it themselves. Raises Unprocessable, and Conflict where members bear it who
    came in by another way: the caller most likely means one of them, and would make them a second time."""
    name = check_name("user", name)
    member = people.find_with_account(session, course, f"name:{name}")
    if member is not None and member.removed_at is None:
        return member
    if member := people.get(session, name, course):
        return member
    if bearers := [bearer for bearer in people.list_bearers(session, course, name) if bearer.account is not None]:
        have = "1 member has" if len(bearers) == 1 else f"{len(bearers)} members have"
        given = "set by an instructor" if any(map(is_named_here, bearers)) else ""
        told = "" if all(map(is_named_here, bearers)) else "from a roster, a platform or another sign-in"
        ids = ", ".join(bearer.id for bearer in bearers)
        raise Conflict(
            f"{have} the name {name!r} already, {' or '.join(filter(None, (given, told)))}: give an id in its place, "
            f"one of {ids}. For another person, write another name."
        )
    return None


def first_name(member: Member) -> str:
    """Returns the name under which an instructor or operator made a member; empty for others. A rename leaves it:
    invitations, tokens and rosters find the member by it, and exports write it as the login."""
    kind, _, name = (member.account or "").partition(":")
    return name if kind == "name" else ""


def is_named_here(member: Member) -> bool:
    """Says whether an instructor or operator gave the member the name."""
    return member.named_by is not None or bool(first_name(member))


def get_with_account(session: Session, account: str, name: str, role: Role, course: str) -> Member:
    """Returns the member with this account; made now with the name and role at the first call."""
    if existing := people.find_with_account(session, course, account):
        existing.removed_at = None
        return existing
    member = Member(id=make_member_id(), course=course, name=name, account=account, role=role.value)
    try:
        with session.begin_nested():
            session.add(member)
    except IntegrityError:  # another process has just made it
        existing = people.find_with_account(session, course, account)
        assert existing is not None
        return existing
    return member


def make_unnamed(session: Session, course: str = DEFAULT_COURSE, name: str | None = None) -> Member:
    """Makes a learner whose browser session is the only way back; without a name, one is made up. Raises Unprocessable.
    The name is a label: others may bear it too."""
    chosen = f"learner-{secrets.token_hex(3)}" if name is None else check_name("learner", name.strip())
    member = Member(id=make_member_id(), course=course, name=chosen, role=Role.STUDENT.value)
    session.add(member)
    session.flush()
    return member


def remove(session: Session, by: Identity, member_id: str) -> None:
    """Ends a member's tokens, sessions and links; the answers stay. Raises NotFound, Conflict, Forbidden,
    Unauthorized."""
    require_credential(session, by)
    member = get_other(session, by, member_id)
    credentials.revoke_all(session, member.id, now())
    member.removed_at = now()
    record(session, by, by.course, Action.MEMBER_REMOVED, member.name, member=member.id)


def change_role(session: Session, by: Identity, member_id: str, role: str) -> Member:
    """Gives another member a role. Raises NotFound, Conflict, Unprocessable, Forbidden, Unauthorized."""
    require_credential(session, by)
    if is_restricted(by):
        raise Forbidden(STUDENTS_ALONE)
    member = get_other(session, by, member_id)
    give_role(session, by, member, check_person_role(role))
    return member


def give_role(
    session: Session, by: Identity | None, member: Member, role: Role, *, unsigned: str = COMMAND_LINE
) -> None:
    """Changes the role of a member, if it is another; every session, token and link of theirs ends with the old one.
    Where `by` is None, the audit log names `unsigned`. Raises Forbidden for a restricted token and a service."""
    if member.role == role:
        return
    if is_restricted(by):
        raise Forbidden(STUDENTS_ALONE)
    member.role = role.value
    credentials.revoke_all(session, member.id, now())
    changed = {"member": member.id, "role": role.value}
    record(session, by, member.course, Action.ROLE_CHANGED, member.name, unsigned=unsigned, **changed)


def set_name(session: Session, by: Identity, member_id: str, name: str | None) -> Member:
    """Gives a member a name that no platform and no roster changes; with None it follows them again. Raises NotFound,
    Unprocessable, Forbidden, Unauthorized, and Conflict where an instructor or operator gave another the name."""
    require_credential(session, by)
    member = people.get(session, member_id, by.course)
    if member is None:
        raise NotFound("There is no such member.")
    require_reach(by, member.role)
    if name is not None:
        name = check_name("member", name.strip())
        require_free(session, member, name)
        rename(session, member, name)
    member.named_by = None if name is None else by.user
    record(session, by, member.course, Action.RENAMED, member.name, member=member.id, follows=name is None)
    return member


def require_free(session: Session, member: Member, name: str) -> None:
    """Raises Conflict if an instructor or operator gave this name to another member, who may be renamed since: an
    invitation or a token for it is theirs."""
    bearers = [bearer for bearer in people.list_bearers(session, member.course, name) if is_named_here(bearer)]
    made = people.find_with_account(session, member.course, f"name:{name}")
    if made is not None and made.removed_at is None:
        bearers.append(made)
    if other := next((bearer for bearer in bearers if bearer.id != member.id), None):
        raise Conflict(
            f"The name {name!r} was given to {other.name} ({other.id}) before: names that an instructor gives are "
            "unique in a course. Write another one."
        )


def follow_name(session: Session, member: Member, name: str) -> None:
    """Gives a member the name that a platform, a roster or a service tells, unless an instructor has set another."""
    if member.named_by is None and member.name != name:
        rename(session, member, name)


def rename(session: Session, member: Member, name: str) -> None:
    """Changes the name: in the sessions and tokens that the member has, and in what gradebooks show."""
    member.name = name
    credentials.rename(session, member.id, name)
    results.touch(session, member.course, member.id)


def check_person_role(role: str) -> Role:
    """Returns the role of this name, if a person may have it who signs in with a link. Raises Unprocessable."""
    checked = check_role(role)
    if checked is Role.SERVICE:
        raise Unprocessable("A service uses a token, not a link: grader token create --role service.")
    return checked


def get_other(session: Session, by: Identity, member_id: str) -> Member:
    """Returns a member of the course other than `by`, who may act on them. Raises NotFound, Conflict, Forbidden."""
    member = people.get(session, member_id, by.course)
    if member is None:
        raise NotFound("There is no such member.")
    if member.id == by.id:
        raise Conflict("Ask another instructor to change your own membership.")
    require_reach(by, member.role)
    return member
