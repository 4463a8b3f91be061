"""`/instructor/people` and the pages under it: members, invitations with the course link, tokens, the audit log. They
need no script."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import timedelta
from typing import Annotated, Any, Literal, get_args
from urllib.parse import urlencode

from fastapi import Depends, Query, Request
from fastapi.responses import RedirectResponse, Response
from sqlalchemy.orm import Session

from grader.courses.people import invitations, tokens
from grader.courses.people import members as rules
from grader.courses.people.audit import Action
from grader.courses.people.external import OWN, known_as
from grader.courses.people.identity import Identity, Role, Scope
from grader.courses.people.namesakes import make_marks
from grader.courses.rules.csv_cells import guard, write_lines
from grader.errors import CallerError, NotFound, Unauthorized, Unprocessable
from grader.gate.late_routes import page_router
from grader.gate.services import AppServices, Services
from grader.store import courses, people, platforms
from grader.store.courses import AuditEntry
from grader.store.people import MemberFilter
from grader.store.tables import ROW_ID_MAX, Credential, Member
from grader.store.upkeep.erasure import PREFIX as ERASED
from grader.web.frame.inputs import Form, Instructor, Visitor
from grader.web.frame.rendering import PRIVATE, page
from grader.web.learner.pages import show_sign_in
from grader.web.text.audit_details import describe_detail

PAGE = "/instructor/people"
Part = Literal["members", "invitations", "tokens", "audit"]
PARTS: tuple[Part, ...] = get_args(Part)
"""What a page shows; the first at `PAGE`, every other at its name under it."""
ROWS = 50
"""Members on one page, and entries of the audit log."""

WAYS = {
    "name": "named here",
    "oidc": "your organisation's sign-in",
    "browser": "came without an invitation",
    "lti": "a platform",
}
"""How a member is found again, by the kind of the account."""

SUBJECTS = {
    "of_answers": {
        Action.CLAIMED,
        Action.RELEASED,
        Action.REVIEWED,
        Action.REVIEW_WITHDRAWN,
        Action.MARKED_SECOND,
        Action.RECOMPUTED,
    },
    "of_members": {Action.SEEN_AS},
    "of_regrades": {Action.REGRADED, Action.REGRADE_CANCELLED},
}
"""The actions whose subject in the audit log is the id of something that has a page."""

ROLES = {"": "everyone", Role.STUDENT: "students", Role.INSTRUCTOR: "instructors", Role.SERVICE: "services"}
"""The roles by which members are shown."""

SAID = {
    "remove": "{name} is removed.",
    "rename": "{name} is the name now.",
    "student": "{name} is a student now. Make a new link for the next sign-in.",
    "instructor": "{name} is an instructor now. Make a new link for the next sign-in.",
}
"""What is said after a change of a member, by the change."""

router = page_router()


@dataclass(frozen=True)
class Listing:
    """Which members the page shows: those of the filter, after the first `start`."""

    wanted: MemberFilter = people.ALL_MEMBERS
    start: int = 0

    def query(self, start: int, **more: str) -> str:
        """Returns the query of the page with these members, after the first `start`, and what `more` it is told."""
        query = {"find": self.wanted.find, "role": self.wanted.role, "start": start, **more}
        encoded = urlencode({name: value for name, value in query.items() if value})
        return f"?{encoded}" if encoded else ""


def read_listing(
    find: Annotated[str, Query(max_length=200)] = "", role: Annotated[str, Query(max_length=20)] = "",
    start: Annotated[int, Query(ge=0, lt=10**6)] = 0,
) -> Listing:  # fmt: skip
    """Reads from the address which members are shown; a role that is not known is none."""
    return Listing(MemberFilter(find.strip(), role if role in ROLES else ""), start)


Listed = Annotated[Listing, Depends(read_listing)]


@router.get(PAGE)
@router.get(f"{PAGE}/invitations")
@router.get(f"{PAGE}/tokens")
@router.get(f"{PAGE}/audit")
def show(
    request: Request, services: AppServices, who: Visitor, listed: Listed, *,
    before: Annotated[int | None, Query(ge=1, le=ROW_ID_MAX)] = None,
    said: Annotated[str, Query(max_length=16)] = "", of: Annotated[str, Query(max_length=32)] = "",
) -> Response:  # fmt: skip
    """A part of the people of a course: members, links, tokens, audit entries before a number; else how to sign in."""
    if who is None or not who.is_instructor:
        return show_sign_in(request, services, who)
    named = request.url.path.rpartition("/")[2]
    part: Part = next((candidate for candidate in PARTS if candidate == named), "members")
    return render(request, services, who, part, listed=listed, before=before, said=said, of=of)


def render(
    request: Request, services: Services, who: Identity, part: Part, status: int = 200, *,
    listed: Listing = Listing(), before: int | None = None, said: str = "", of: str = "", **more: Any,
) -> Response:  # fmt: skip
    """Renders a part as it is now, with the outcome of a form: what was `typed`, `links` shown once, a `token`; or
    what is `said` of the change `of` a member."""
    with services.database.read() as session:
        members = people.list_by_name(session, who.course, listed.start, ROWS, listed.wanted)
        entries = courses.audit_page(session, who.course, before, ROWS + 1)
        link = courses.find_link(session, who.course)
        context: dict[str, Any] = {
            "part": part,
            "members": list_members(session, who, members),
            "changed": people.find(session, of, who.course) if said else None,
            "count": people.count(session, who.course, listed.wanted),
            "course_count": people.count(session, who.course),
            "invitations": [
                tokens.describe_credential(credential)
                for credential in invitations.list_pending(session, who.course)
                if is_invitation(credential)
            ],
            "tokens": [tokens.describe_credential(token) for token in tokens.list_tokens(session, who.course)],
            "audit": [
                (entry, *describe_subject(entry), describe_detail(entry.action, entry.detail))
                for entry in entries[:ROWS]
            ],
            "marks": make_marks(session, who.course),
            "more_audit": entries[ROWS - 1].id if len(entries) > ROWS else None,
        }
    join_url = None if link is None else f"{services.origin_of(request)}/join?code={link.code}"
    context |= {
        "said": describe_change(said, context["changed"]),
        "join_url": join_url,
        "roles": list(Role),
        "scopes": list(Scope),
        "typed": {},
        "listed": listed,
        "rows": ROWS,
        "shown_roles": ROLES,
        "is_open": services.sessions.anonymous,
        **SUBJECTS,
    }
    return page(request, "people.html", status, PRIVATE, who=who, **(context | more))


def is_invitation(link: Credential) -> bool:
    """Says whether a pending link is an invitation, and not a learner's own to come back."""
    return link.expires_at is not None and link.expires_at - link.created_at < 2 * invitations.INVITATION


def list_members(session: Session, who: Identity, members: Sequence[Member]) -> list[dict[str, Any]]:
    """Members with where they come from, and whether another has the same address."""
    launched = platforms.find_courses(session, [member.id for member in members])
    twins = people.sharing_email(session, who.course, members)
    return [
        {
            "row": member,
            "origin": ", ".join(f"{name}: {title}" for name, title in launched.get(member.id, ()))
            or describe_origin(member),
            "has_twin": bool(twins.get(member.id)),
            "is_self": member.id == who.id,
            "first_name": rules.first_name(member),
        }
        for member in members
    ]


def describe_change(said: str, member: Member | None) -> str:
    """Says what a form has changed of a member, as the member is now; nothing where that is not so any more."""
    if member is None or (member.removed_at is not None) != (said == "remove"):
        return ""
    way_back = describe_return(member) if said == "remove" else ""
    return f"{SAID.get(said, '').format(name=member.name)} {way_back}".strip()


def describe_return(member: Member) -> str:
    """Says how a removed member comes back; nothing of one who was erased."""
    if name := rules.first_name(member):
        return f"To bring them back, with their answers and points, invite “{name}” as {member.role} again."
    if member.name.startswith(ERASED):
        return ""
    return (
        "To bring them back, with their answers and points, import a roster with their name, the namespace "
        f"{OWN} and the external_id {member.id}."
    )


def describe_origin(member: Member) -> str:
    """Says where a member comes from who was launched by no platform."""
    way = "browser" if member.account is None else member.account.partition(":")[0]
    if way == "lms":
        known = known_as(member)
        return f"{known.namespace}: {known.id}"
    return WAYS.get(way, way)


def describe_subject(entry: AuditEntry) -> tuple[str, str | None]:
    """Returns the object of an audited action in words, and the id of the member if it names one."""
    detail = json.loads(entry.detail)
    if entry.action == Action.EXTENDED and detail:  # that of an erased learner is empty
        return f"{entry.subject}, {detail['name']}", detail["member"]
    return entry.subject, None if entry.action == Action.REPLAYED else detail.get("member")


@router.post(f"{PAGE}/invitations")
def invite(request: Request, services: AppServices, who: Instructor, form: Form) -> Response:
    """Makes a single-use link for each name, and shows them this once; shows the page again if it is refused."""
    names = [name for line in form.get("names", "").splitlines() if (name := line.strip())]
    try:
        if not names:
            raise Unprocessable("Write at least one name.")
        if len(names) > invitations.NAMES_AT_ONCE:
            raise Unprocessable(f"Invite at most {invitations.NAMES_AT_ONCE} at once.")
        with services.database.write() as session:
            created = invitations.invite(session, who, who.course, names, form.get("role", ""))
    except CallerError as error:
        return render(request, services, who, "invitations", 422, typed=form, trouble=str(error))
    return render_links(request, services, who, "invitations", created)


def render_links(
    request: Request, services: Services, who: Identity, part: Part, created: Sequence[invitations.Invitation], *,
    listed: Listing = Listing(),
) -> Response:  # fmt: skip
    """Renders the page with new links, which are shown this once."""
    origin = services.origin_of(request)
    links = [(invitation.member.name, f"{origin}/signin?code={invitation.code}") for invitation in created]
    table = "".join(write_lines([("name", "link"), *((guard(name), url) for name, url in links)]))
    return render(request, services, who, part, listed=listed, links=links, links_table=table)


@router.post(f"{PAGE}/invitations/{{invitation}}/revoke")
def revoke_invitation(invitation: str, services: AppServices, who: Instructor) -> Response:
    """Ends a link that was not used. Raises Unauthorized, Forbidden, NotFound."""
    with services.database.write() as session:
        invitations.revoke(session, who, invitation)
    return RedirectResponse(f"{PAGE}/invitations#pending-title", 303)


@router.post(f"{PAGE}/link")
def change_link(services: AppServices, who: Instructor, form: Form) -> Response:
    """Makes a new course link, or with `close` ends it. Raises Unauthorized, Forbidden."""
    with services.database.write() as session:
        if "close" in form:
            invitations.close_link(session, who)
        else:
            invitations.rotate_link(session, who)
    return RedirectResponse(f"{PAGE}/invitations#course-title", 303)


@router.post(f"{PAGE}/members/{{member_id}}")
def change_member(
    request: Request, member_id: str, services: AppServices, who: Instructor, form: Form, *, listed: Listed
) -> Response:
    """Makes a new link for a member, which is shown this once; changes the role or the name; or removes. `do` says
    which. Shows the same members again, with what was done, or why not. Raises Unauthorized, Forbidden."""
    do = form.get("do", "")
    try:
        with services.database.write() as session:
            if do == "remove":
                rules.remove(session, who, member_id)
            elif do == "rename":
                rules.set_name(session, who, member_id, form.get("name", "").strip() or None)
            elif do in (Role.STUDENT, Role.INSTRUCTOR):
                rules.change_role(session, who, member_id, do)
            elif do == "link":
                member = people.get(session, member_id, who.course)
                if member is None:
                    raise NotFound("There is no such member.")
                invitation = invitations.invite_member(session, who, member)
    except Unauthorized:
        raise
    except CallerError as error:
        return render(request, services, who, "members", 409, listed=listed, trouble=str(error))
    if do == "link":
        return render_links(request, services, who, "members", [invitation], listed=listed)
    query = listed.query(listed.start, said=do if do in SAID else "", of=member_id)
    return RedirectResponse(PAGE + query, 303)


@router.post(f"{PAGE}/tokens")
def create_token(request: Request, services: AppServices, who: Instructor, form: Form) -> Response:
    """Creates a token and shows it this once; shows the page again if it is refused. Asks first, before a name that the
    course does not know becomes a new user."""
    scopes = [scope for scope in Scope if f"scope-{scope}" in form]
    user = form.get("user", "").strip()
    try:
        with services.database.read() as session:
            is_known = rules.find_meant(session, user, who.course) is not None
            bear_it = people.count_bearers(session, who.course, user)
        if not is_known and form.get("new") != user:
            return render(request, services, who, "tokens", typed=form, unknown=user, bear_it=bear_it)
        with services.database.write() as session:
            text = tokens.create_token(
                session, user, form.get("role", ""), who.course, scopes=scopes or None,
                lifetime=parse_lifetime(form.get("days", "")), by=who,
            )  # fmt: skip
    except CallerError as error:
        return render(request, services, who, "tokens", 422, typed=form, trouble=str(error))
    return render(request, services, who, "tokens", token=(user, text))


def parse_lifetime(days: str) -> timedelta | None:
    """Says how long a token is to be valid; None for no end. Raises Unprocessable."""
    if not days.strip():
        return None
    if not days.strip().isdecimal() or not 1 <= int(days) <= tokens.DAYS_MAX:
        raise Unprocessable(f"Days are a whole number of 1 to {tokens.DAYS_MAX}.")
    return timedelta(days=int(days))


@router.post(f"{PAGE}/tokens/{{token_id}}/revoke")
def revoke_token(token_id: str, services: AppServices, who: Instructor) -> Response:
    """Ends a token. Raises Unauthorized, Forbidden, NotFound."""
    with services.database.write() as session:
        tokens.revoke(session, token_id, who.course, who)
    return RedirectResponse(f"{PAGE}/tokens", 303)
