"""Members whom another system knows: found by its namespace and id, and made at first sight."""

import hashlib
import re
from dataclasses import dataclass

from sqlalchemy.orm import Session

from grader.courses.people import members
from grader.courses.people.audit import Action, record
from grader.courses.people.identity import Identity, Role, check_name
from grader.errors import Forbidden, Unprocessable
from grader.store import people as stored_people
from grader.store.engine.database import Database
from grader.store.tables import EXTERNAL_ID, NAME, NAMESPACE, Member

OWN = "grader"
"""The namespace of our own ids of members."""

NAMESPACES = re.compile(rf"[A-Za-z0-9][A-Za-z0-9._-]{{0,{NAMESPACE - 1}}}")


@dataclass(frozen=True)
class External:
    """A person as another system knows them: `id` is theirs in the system named by `namespace`."""

    namespace: str
    id: str

    @property
    def account(self) -> str:
        """The account of the member. No namespace holds a line break, so that two persons never share one."""
        digest = hashlib.sha256(f"{self.namespace}\n{self.id}".encode()).hexdigest()
        return f"lms:{digest}"

    @property
    def label(self) -> str:
        """The name shown for a person who came without one."""
        return f"{self.namespace}:{self.id}"[:NAME]


def check_external(namespace: str, external_id: str) -> External:
    """Returns the person of this id. Raises Unprocessable if it cannot be one, or is in our own namespace."""
    if not NAMESPACES.fullmatch(namespace) or namespace == OWN:
        raise Unprocessable(
            f"A namespace is 1 to {NAMESPACE} letters, digits, dots, hyphens and underscores, and not {OWN!r}, which "
            "is for our own ids."
        )
    if not 1 <= len(external_id) <= EXTERNAL_ID or not external_id.isprintable() or external_id != external_id.strip():
        raise Unprocessable(f"An id is 1 to {EXTERNAL_ID} printable characters, without blanks around them.")
    return External(namespace, external_id)


def known_as(member: Member) -> External:
    """Says how other systems may name a member: by its own id where no other system knows it."""
    if member.namespace is None or member.external_id is None:
        return External(OWN, member.id)
    return External(member.namespace, member.external_id)


def get_member(session: Session, course: str, who: External, name: str | None, role: Role = Role.STUDENT) -> Member:
    """The member whom another system knows so, also a removed one; made now at the first call. Raises Unprocessable."""
    existing = stored_people.find_with_account(session, course, who.account)
    if existing is not None:
        return existing
    chosen = who.label if name is None else check_name("learner", name)
    member = members.get_with_account(session, who.account, chosen, role, course)
    member.namespace, member.external_id = who.namespace, who.id
    return member


def find_learner(database: Database, service: Identity, who: External, name: str | None) -> Identity:
    """Returns the learner for whom a service acts, with the service's credential and a student's rights. At first sight
    they become a member of the service's course. A `name` replaces the earlier one, unless an instructor set
    that. Raises Unprocessable, and Forbidden for a learner whom an instructor has removed."""
    if name is not None:
        name = check_name("learner", name)
    with database.read() as session:
        member = stored_people.find_with_account(session, service.course, who.account)
    is_news = member is not None and name not in (None, member.name) and member.named_by is None
    if member is None or (is_news and member.removed_at is None):
        with database.write() as session:
            member = enter(session, service, who, name)
    if member.removed_at is not None:
        raise Forbidden("An instructor has removed this learner from the course.")
    return Identity(member.id, member.name, Role.STUDENT, service.course, credential=service.credential)


def enter(session: Session, service: Identity, who: External, name: str | None) -> Member:
    """Returns the member, made or renamed; an instructor keeps the name. Raises Unauthorized if the token has ended."""
    members.require_credential(session, service)
    known = stored_people.find_with_account(session, service.course, who.account)
    member = get_member(session, service.course, who, name)
    if known is None:
        session.flush()
        record(session, service, service.course, Action.JOINED, member.name, member=member.id)
    elif name is not None and member.removed_at is None and member.role == Role.STUDENT:
        members.follow_name(session, member, name)
    return member
