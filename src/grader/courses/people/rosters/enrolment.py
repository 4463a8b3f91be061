"""Brings the members of a course in line with a roster: who is new, who changes, and what cannot be."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import Session

from grader.courses.people.audit import Action, record
from grader.courses.people.external import OWN, External, known_as
from grader.courses.people.identity import Identity, Role
from grader.courses.people.members import follow_name, give_role, is_restricted, require_credential
from grader.courses.people.rosters.roster import FAULTS_MAX, Entry
from grader.errors import Conflict, Fault, FaultyRows
from grader.store import people, results
from grader.store.engine.database import Database
from grader.store.engine.ids import make_member_id
from grader.store.tables import Member

NAMED = "name:"


@dataclass(frozen=True)
class Enrolment:
    """What a roster comes to, in members. Those of a course who are not on it stay as they are. `left_out` are
    instructors, and members whom an instructor has removed, where the caller may not enter them."""

    dry_run: bool
    created: int
    changed: int
    unchanged: int
    left_out: int


@dataclass
class _Plan:
    created: list[Entry] = field(default_factory=list)
    changed: list[tuple[Member, dict[str, Any]]] = field(default_factory=list)
    unchanged: int = 0
    left_out: int = 0
    faults: list[Fault] = field(default_factory=list)


def enrol(
    database: Database, session: Session, by: Identity | None, course: str, entries: Sequence[Entry], *, file: str,
    dry_run: bool = False,
) -> Enrolment:  # fmt: skip
    """Makes the people on a roster members, and gives those who are members the roster's name, role and address.

    `by` is None for the command line. An instructor without restriction enters anybody, and brings back whom they had
    removed; a service and a restricted token enter students alone. Once done, the same roster changes nothing.
    Raises FaultyRows, of the `file`, Conflict and Unauthorized.
    """
    database.lock(session, f"roster\n{course}")
    require_credential(session, by)
    plan = plan_changes(session, by, course, file, entries)
    if plan.faults:
        raise FaultyRows(plan.faults[:FAULTS_MAX])
    done = Enrolment(dry_run, len(plan.created), len(plan.changed), plan.unchanged, plan.left_out)
    if not dry_run:
        create_members(session, course, plan.created)
        for member, changes in plan.changed:
            change_member(session, by, member, changes)
        if plan.created or plan.changed:
            record(session, by, course, Action.ROSTER_IMPORTED, file, **{**asdict(done), "dry_run": False})
    return done


def plan_changes(session: Session, by: Identity | None, course: str, file: str, entries: Sequence[Entry]) -> _Plan:
    """Says what a roster would change, and what cannot be."""
    enters_anybody = not is_restricted(by)
    known = people.list_members(session, course)
    by_account = {member.account: member for member in known if member.account is not None}
    by_id = {member.id: member for member in known}
    plan = _Plan()
    for entry in entries:
        member = by_account.get(entry.key) or by_id.get(entry.external.id if entry.external else "")
        if not enters_anybody and is_beyond(entry, member):
            plan.left_out += 1
        elif member is None:
            plan_member(plan, file, entry)
        elif changes := compare_member(member, entry):
            if by is not None and member.id == by.id and "role" in changes:
                plan.faults.append(Fault(file, f"line {entry.line}, role", "ask another instructor to change your own"))
            plan.changed.append((member, changes))
        else:
            plan.unchanged += 1
    return plan


def is_beyond(entry: Entry, member: Member | None) -> bool:
    """Says whether a service or a restricted token may not enter somebody: instructors, and who was removed."""
    is_known = member is not None and (member.role != Role.STUDENT or member.removed_at is not None)
    return entry.role is not Role.STUDENT or is_known


def plan_member(plan: _Plan, file: str, entry: Entry) -> None:
    """Adds a person to the future members, unless the row gives an id of this service that is unknown."""
    if entry.external is not None and entry.external.namespace == OWN:
        why = f"no member of this course has this id: leave namespace and external_id empty to enter {entry.name!r} new"
        plan.faults.append(Fault(file, f"line {entry.line}, external_id", why))
    else:
        plan.created.append(entry)


def compare_member(member: Member, entry: Entry) -> dict[str, Any]:
    """Returns the columns of a member that a roster changes; a name that an instructor set is none of them."""
    wanted: dict[str, Any] = {"role": entry.role.value, "removed_at": None}
    if member.named_by is None:
        wanted["name"] = entry.name
    if entry.email is not None:
        wanted["email"] = entry.email or None
    return {name: value for name, value in wanted.items() if getattr(member, name) != value}


def create_members(session: Session, course: str, entries: Sequence[Entry]) -> None:
    """Makes members. Raises Conflict if another request has just made one of them."""
    for entry in entries:
        member = Member(id=make_member_id(), course=course, name=entry.name, account=entry.key, role=entry.role.value)
        member.email = entry.email or None
        if entry.external is not None:
            member.namespace, member.external_id = entry.external.namespace, entry.external.id
        session.add(member)
    try:
        session.flush()
    except IntegrityError as error:
        raise Conflict("Somebody entered the same people at this moment: import the roster again.") from error


def change_member(session: Session, by: Identity | None, member: Member, changes: dict[str, Any]) -> None:
    """Changes a member. With another role they sign in again, as after any change of it."""
    for name, value in changes.items():
        if name not in ("role", "name"):
            setattr(member, name, value)
    follow_name(session, member, changes.get("name", member.name))
    give_role(session, by, member, Role(changes.get("role", member.role)))
    results.touch(session, member.course, member.id)


def list_roster(session: Session, course: str) -> list[Entry]:
    """Returns the students and instructors of a course, as a roster in our own form: whom a name finds has no id."""
    return [
        make_entry(member, None if is_named(member) else known_as(member))
        for member in people.list_enrolled(session, course)
    ]


def list_roster_with_ids(session: Session, course: str, namespace: str) -> list[Entry]:
    """As `list_roster`, each with an id: that of the namespace, else ours."""
    entries = []
    for member in people.list_enrolled(session, course):
        known = known_as(member)
        entries.append(make_entry(member, known if known.namespace == namespace else External(OWN, member.id)))
    return entries


def is_named(member: Member) -> bool:
    """Says whether an instructor or operator made the member by the name that they still have."""
    return member.account == f"{NAMED}{member.name}"


def make_entry(member: Member, external: External | None) -> Entry:
    """Returns a member as a row of a roster."""
    return Entry(0, member.name, Role(member.role), member.email or "", external)
