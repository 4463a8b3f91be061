"""Names and Role Provisioning Services: the members of a platform's course, pulled into ours. Source: LTI NRPS 2.0,
section 2."""

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from sqlalchemy.orm import Session

from grader.courses.people import members
from grader.courses.people import platforms as rules
from grader.courses.people.audit import Action, record
from grader.courses.people.identity import Identity, Role
from grader.courses.people.platforms import Person
from grader.courses.people.rosters.roster import is_email
from grader.domain.platform import Platform
from grader.errors import Conflict, Forbidden, Unprocessable
from grader.platforms.launching import claims as words
from grader.platforms.launching.addresses import is_of_platform, read_origin
from grader.platforms.launching.launch import read_name
from grader.store.platforms import ID, Context

if TYPE_CHECKING:  # it needs the packages of the extra
    from grader.platforms.sending.access_tokens import AccessTokens
    from grader.platforms.sending.outgoing import Response

MEDIA_TYPE = "application/vnd.ims.lti-nrps.v2.membershipcontainer+json"
PAGES_MAX = 200
MEMBERS_MAX = 20_000
NEXT = re.compile(r'<([^<>]*)>[^,<]*;\s*rel="?next"?', re.IGNORECASE)


@dataclass(frozen=True)
class PulledRoster:
    """What a roster came to: members here, and people whom an instructor had removed."""

    members: int
    removed: int


async def pull(authorized: "AccessTokens", platform: Platform, url: str) -> list[Person]:
    """The active members of a platform's course, page by page. Raises Unprocessable if the platform does not tell."""
    people, following, visited = dict[str, Person](), url, set[str]()
    while following:
        if following in visited or len(visited) >= PAGES_MAX or read_origin(following) != read_origin(url):
            raise Unprocessable("The platform's roster goes on at an address that makes no sense.")
        visited.add(following)
        answer = await fetch_page(authorized, platform, following)
        people |= {person.subject: person for person in read_persons(answer.body, platform.issuer)}
        if len(people) > MEMBERS_MAX:
            raise Unprocessable(f"The platform's roster is too long: at most {MEMBERS_MAX} members are taken.")
        following = read_next(answer.headers)
    return list(people.values())


async def fetch_page(authorized: "AccessTokens", platform: Platform, url: str) -> "Response":
    """Returns one page of the roster. Raises Unprocessable."""
    try:
        answer = await authorized.request(platform, [words.MEMBERS], "GET", url, headers={"Accept": MEDIA_TYPE})
    except Exception as error:  # whatever the other side, or the way to it, does wrong
        raise Unprocessable(f"The platform does not give its roster: {error}") from error
    if answer.status != 200:
        raise Unprocessable(f"The platform does not give its roster: it answers {answer.status}.")
    return answer


def read_next(headers: Mapping[str, str]) -> str:
    """Returns the address of the next page; empty after the last one."""
    match = NEXT.search(next((value for name, value in headers.items() if name.lower() == "link"), ""))
    return match[1] if match and is_of_platform(match[1]) else ""


def read_persons(body: bytes, issuer: str) -> list[Person]:
    """Returns the active members on one page. Raises Unprocessable."""
    try:
        listed = json.loads(body)["members"]
        active = [entry for entry in listed if entry.get("status", "Active") == "Active" and is_known(entry)]
        return [read_person(entry, issuer) for entry in active]
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise Unprocessable("The platform's roster cannot be read.") from error


def is_known(member: Mapping[str, Any]) -> bool:
    """Says whether the platform says who this is."""
    subject = member.get("user_id")
    return isinstance(subject, str) and 1 <= len(subject) <= ID and subject.isprintable()


def read_person(member: Mapping[str, Any], issuer: str) -> Person:
    """Returns a member as the platform describes them."""
    roles = [role for role in member.get("roles", ()) if isinstance(role, str)]
    role = Role.INSTRUCTOR if words.teaches(roles) else Role.STUDENT
    email = member.get("email")
    is_known = isinstance(email, str) and is_email(email)
    return Person(issuer, member["user_id"], read_name(member), role, email if is_known else None)


def find_source(session: Session, context_id: int) -> Context:
    """Returns the platform's course whose roster can be pulled. Raises NotFound, Conflict."""
    context = rules.get_context(session, context_id)
    if context.course is None:
        raise Conflict("This course of a platform is not linked with a course here.")
    if not context.members_url:
        raise Conflict("The platform offers no roster (Names and Roles) for this course, or has not launched it yet.")
    return context


def enter(session: Session, by: Identity | None, context: Context, people: Sequence[Person]) -> PulledRoster:
    """Makes the people members of the linked course; those of an earlier roster who are missing stay. Raises
    Unauthorized if the caller's right ended while the platform answered."""
    assert context.course is not None
    members.require_credential(session, by)
    removed = 0
    for person in people:
        try:
            rules.get_member(session, context, person)
        except Forbidden:
            removed += 1
    pulled = PulledRoster(len(people) - removed, removed)
    record(session, by, context.course, Action.ROSTER_PULLED, context.title, members=pulled.members)
    return pulled
