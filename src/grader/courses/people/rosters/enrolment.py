"""Brings the members of a course in line with a roster: who is new, who changes, and what cannot be."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import Session

from grader.courses.people.audit import Action, record
from grader.courses.people.external import OWN, External, known_as
from grader.courses.people.identity import Identity, Role
from grader.courses.people.members import follow_name, give_role, is_restricted, require_credential
from grader.courses.people.rosters.roster import FAULTS_MAX, Entry, Roster
from grader.errors import Conflict, Fault, FaultyRows
from grader.store import people, results
from grader.store.engine.database import Database
from grader.store.engine.ids import make_member_id
from grader.store.tables import Member

NAMED = "name:"

BEYOND = "only an instructor without restriction enters instructors, and members who were removed"

LAST = "is the last instructor: make another one first, or leave the cell empty to keep the role"


@dataclass(frozen=True)
class RoleChange:
    """A member whose role a roster changes."""

    id: str
    name: str
    before: str
    after: str


@dataclass(frozen=True)
class LeftOut:
    """How many people a roster leaves out for one reason."""

    why: str
    people: int


@dataclass(frozen=True)
class Namesake:
    """A member who bears a name of a roster, and is found by none of its rows."""

    id: str
    name: str


@dataclass(frozen=True)
class Enrolment:
    """What a roster comes to, in members. Those of a course who are not on it stay as they are. `left_out` are people
    whom the file or the caller's rights exclude, for `reasons`; `roles` are the members whose role changes.
    `namesakes` may be people of the roster who came in by another way, and are members twice."""

    dry_run: bool
    created: int
    changed: int
    unchanged: int
    left_out: int
    reasons: Sequence[LeftOut] = ()
    roles: Sequence[RoleChange] = ()
    namesakes: Sequence[Namesake] = ()

    def count(self) -> dict[str, Any]:
        """Returns the numbers by name, without anybody's name."""
        return {name: getattr(self, name) for name in ("created", "changed", "unchanged", "left_out")}


@dataclass
class _Plan:
    left_out: Counter[str]
    created: list[Entry] = field(default_factory=list)
    changed: list[tuple[Member, dict[str, Any]]] = field(default_factory=list)
    unchanged: int = 0
    dismissed: list[Entry] = field(default_factory=list)
    faults: list[Fault] = field(default_factory=list)
    namesakes: list[Member] = field(default_factory=list)


def enrol(
    database: Database, session: Session, by: Identity | None, course: str, roster: Roster, *, dry_run: bool = False
) -> Enrolment:
    """Makes the people on a roster members, and gives those who are members the roster's name, role and address.

    `by` is None for the command line. An instructor without restriction enters anybody, and brings back whom they had
    removed; a service and a restricted token enter students alone. Once done, the same roster changes nothing.
    Raises FaultyRows, also where no instructor would be left, Conflict and Unauthorized.
    """
    database.lock(session, f"roster\n{course}")
    require_credential(session, by)
    plan = plan_changes(session, by, course, roster)
    if plan.faults:
        raise FaultyRows(plan.faults[:FAULTS_MAX])
    done = describe_plan(plan, dry_run=dry_run)
    if not dry_run:
        create_members(session, course, plan.created)
        for member, changes in plan.changed:
            change_member(session, by, member, changes)
        if plan.created or plan.changed:
            record(session, by, course, Action.ROSTER_IMPORTED, roster.file, **done.count(), dry_run=False)
    return done


def describe_plan(plan: _Plan, *, dry_run: bool) -> Enrolment:
    """Says what a plan comes to; of very many reasons the most frequent."""
    return Enrolment(
        dry_run, len(plan.created), len(plan.changed), plan.unchanged, plan.left_out.total(),
        [LeftOut(why, people) for why, people in plan.left_out.most_common(FAULTS_MAX)],
        [
            RoleChange(member.id, changes.get("name", member.name), member.role, changes["role"])
            for member, changes in plan.changed if "role" in changes
        ],
        [Namesake(member.id, member.name) for member in plan.namesakes],
    )  # fmt: skip


def plan_changes(session: Session, by: Identity | None, course: str, roster: Roster) -> _Plan:
    """Says what a roster would change, and what cannot be."""
    enters_anybody = not is_restricted(by)
    known = people.list_members(session, course)
    by_account = {member.account: member for member in known if member.account is not None}
    by_id = {member.id: member for member in known}
    plan = _Plan(Counter(roster.left_out))
    found: list[Member | None] = []
    for entry in roster.entries:
        member = by_account.get(entry.key) or by_id.get(entry.external.id if entry.external else "")
        found.append(member)
        if not enters_anybody and is_beyond(entry, member):
            plan.left_out[BEYOND] += 1
        elif member is None:
            plan_member(plan, roster, entry)
        elif changes := compare_member(member, entry):
            if by is not None and member.id == by.id and "role" in changes:
                plan.faults.append(roster.fault(entry, "role", "ask another instructor to change your own role"))
            if "role" in changes and member.role == Role.INSTRUCTOR and member.removed_at is None:
                plan.dismissed.append(entry)
            plan.changed.append((member, changes))
        else:
            plan.unchanged += 1
    if plan.dismissed and not plan.faults and not keeps_instructor(plan, known):
        plan.faults += [roster.fault(entry, "role", LAST) for entry in plan.dismissed]
    plan.namesakes += list_namesakes(roster, known, found)
    return plan


def list_namesakes(roster: Roster, known: Sequence[Member], found: Sequence[Member | None]) -> list[Member]:
    """Returns the members who bear a name of the roster, and are not among those whom a row has found."""
    names, ids = {entry.name for entry in roster.entries}, {member.id for member in found if member is not None}
    return [member for member in known if member.name in names and member.id not in ids and member.removed_at is None]


def keeps_instructor(plan: _Plan, known: Sequence[Member]) -> bool:
    """Says whether a course has an instructor once a plan is carried out."""
    roles = {member.id: member.role for member in known if member.removed_at is None}
    roles |= {member.id: changes.get("role", member.role) for member, changes in plan.changed}
    return Role.INSTRUCTOR in (*roles.values(), *(entry.role for entry in plan.created))


def is_beyond(entry: Entry, member: Member | None) -> bool:
    """Says whether a service or a restricted token may not enter somebody: instructors, and who was removed."""
    is_known = member is not None and (member.role != Role.STUDENT or member.removed_at is not None)
    return entry.role is Role.INSTRUCTOR or is_known


def plan_member(plan: _Plan, roster: Roster, entry: Entry) -> None:
    """Adds a person to the future members, unless the row gives an id of this service that is unknown."""
    if entry.external is not None and entry.external.namespace == OWN:
        why = f"no member of this course has this id: leave namespace and external_id empty to enter {entry.name!r} new"
        plan.faults.append(roster.fault(entry, "external_id", why))
    else:
        plan.created.append(entry)


def compare_member(member: Member, entry: Entry) -> dict[str, Any]:
    """Returns the columns of a member that a roster changes: none on which it says nothing, and no name that an
    instructor set."""
    wanted: dict[str, Any] = {"removed_at": None}
    if entry.role is not None:
        wanted["role"] = entry.role.value
    if member.named_by is None:
        wanted["name"] = entry.name
    if entry.email is not None:
        wanted["email"] = entry.email or None
    return {name: value for name, value in wanted.items() if getattr(member, name) != value}


def create_members(session: Session, course: str, entries: Sequence[Entry]) -> None:
    """Makes members. Raises Conflict if another request has just made one of them."""
    for entry in entries:
        role = entry.role or Role.STUDENT
        member = Member(id=make_member_id(), course=course, name=entry.name, account=entry.key, role=role.value)
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
