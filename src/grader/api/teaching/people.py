"""`/members`, `/invitations`, `/tokens`, `/course`, `/audit`: who takes part in a course, for its instructors."""

from collections.abc import Sequence
from datetime import timedelta
from typing import Annotated, Any

from fastapi import Query, Request, Response
from pydantic import ConfigDict, Field
from sqlalchemy.orm import Session

from grader.api.bodies import RequestBody
from grader.api.paging import NO_NUL, CursorQuery, Cut, Page, build_page
from grader.api.views import AuditView, CourseView, CredentialView, MemberView, NewInvitation, NewToken
from grader.courses.people import invitations, members, tokens
from grader.courses.people.external import known_as
from grader.courses.people.identity import Role, Scope
from grader.courses.people.invitations import Invitation
from grader.courses.reviewing.blinding import Unseen, find_unseen, limit_detail
from grader.errors import NotFound, Unprocessable
from grader.gate.callers import Instructor, api_router
from grader.gate.problems import refusals
from grader.gate.services import AppServices, Services
from grader.store import courses as stored_courses
from grader.store import people as stored_people
from grader.store import platforms
from grader.store.courses import AuditEntry
from grader.store.tables import Member

router = api_router("people")


class ListQuery(CursorQuery):
    """Which page of a list."""

    model_config = ConfigDict(extra="forbid")


ListParams = Annotated[ListQuery, Query()]


class MemberBody(RequestBody):
    """What changes of a member: the role, the name, or both. A name of null follows platforms and rosters again."""

    role: Role | None = None
    name: str | None = Field(default=None, pattern=NO_NUL)


class InvitationBody(RequestBody):
    """Whom to invite: new or old members by their names or ids, or one member by id."""

    names: list[str] = Field(default_factory=list, max_length=invitations.NAMES_AT_ONCE)
    role: Role = Role.STUDENT
    member: str | None = Field(default=None, max_length=32, pattern=NO_NUL)


class TokenBody(RequestBody):
    """A token to create. `user` is a name, or the id of a member. Without `scopes` it may do what the role may; without
    `days` it does not expire."""

    user: str
    role: Role
    scopes: list[Scope] | None = None
    days: float | None = Field(default=None, gt=0, le=tokens.DAYS_MAX)


@router.get("/members", response_model=Page[MemberView], responses=refusals(401, 403, 422, 429))
def list_members(query: ListParams, who: Instructor, services: AppServices, response: Response) -> dict[str, Any]:
    """Lists the members of the course in the order of their ids."""
    with services.database.read() as session:
        members = stored_people.page(session, who.course, query.start, query.limit + 1)
        views = describe_members(session, who.course, members)
    return build_page(views, query, "/members", response)


@router.patch("/members/{member_id}", response_model=MemberView, responses=refusals(401, 403, 404, 409, 413, 422, 429))
def change_member(member_id: str, body: MemberBody, who: Instructor, services: AppServices) -> dict[str, Any]:
    """Changes a member's role or name. With another role tokens, sessions and links end: sign in with a new link.

    A name that is set here stays, whatever platforms and rosters tell. A restricted token changes no member.
    """
    if body.role is None and "name" not in body.model_fields_set:
        raise Unprocessable("Give a `role`, a `name` or both.")
    with services.database.write() as session:
        if "name" in body.model_fields_set:
            members.set_name(session, who, member_id, body.name)
        if body.role is not None:
            members.change_role(session, who, member_id, body.role)
        return describe_members(session, who.course, [session.get_one(Member, member_id)])[0]


@router.delete("/members/{member_id}", status_code=204, responses=refusals(401, 403, 404, 409, 422, 429))
def remove_member(member_id: str, who: Instructor, services: AppServices) -> None:
    """Ends a member's tokens, sessions and links. The answers stay."""
    with services.database.write() as session:
        members.remove(session, who, member_id)


@router.get("/invitations", response_model=Page[CredentialView], responses=refusals(401, 403, 422, 429))
def list_invitations(who: Instructor, services: AppServices, cut: Cut) -> dict[str, Any]:
    """Lists the links that were neither used nor revoked, newest first."""
    with services.database.read() as session:
        credentials = invitations.list_pending(session, who.course)
    return cut([tokens.describe_credential(credential) for credential in credentials])


@router.post(
    "/invitations",
    status_code=201,
    response_model=Page[NewInvitation],
    responses=refusals(401, 403, 404, 409, 413, 422, 429),
)
def create_invitations(
    body: InvitationBody, who: Instructor, services: AppServices, request: Request
) -> dict[str, Any]:
    """Makes a single-use link for each name, or for one member. The links are shown this once.

    409 for a name that is a member with another role: an invitation changes none. 409 too for one that only members
    from a roster, a platform or another sign-in have: give the id in its place. A restricted token invites students.
    """
    if bool(body.names) == (body.member is not None):
        raise Unprocessable("Give either `names` or `member`.")
    with services.database.write() as session:
        if body.member is None:
            created = invitations.invite(session, who, who.course, body.names, body.role)
        else:
            member = stored_people.get(session, body.member, who.course)
            if member is None:
                raise NotFound("There is no such member.")
            created = [invitations.invite_member(session, who, member)]
    origin = services.origin_of(request)
    return {"items": [describe_invitation(invitation, origin) for invitation in created], "next_cursor": None}


@router.delete("/invitations/{invitation_id}", status_code=204, responses=refusals(401, 403, 404, 422, 429))
def revoke_invitation(invitation_id: str, who: Instructor, services: AppServices) -> None:
    """Ends a link that was not used yet."""
    with services.database.write() as session:
        invitations.revoke(session, who, invitation_id)


@router.get("/tokens", response_model=Page[CredentialView], responses=refusals(401, 403, 422, 429))
def list_tokens(who: Instructor, services: AppServices, cut: Cut) -> dict[str, Any]:
    """Lists the tokens that are valid, newest first; never their secrets."""
    with services.database.read() as session:
        credentials = tokens.list_tokens(session, who.course)
    return cut([tokens.describe_credential(credential) for credential in credentials])


@router.post("/tokens", status_code=201, response_model=NewToken, responses=refusals(401, 403, 409, 413, 422, 429))
def create_token(body: TokenBody, who: Instructor, services: AppServices) -> dict[str, Any]:
    """Creates a token. It is shown this once.

    409 for a name that is a member with another role, or that only members from a roster, a platform or another sign-in
    have: give the id in its place. A restricted token creates tokens of students, within its own
    scopes and its own time.
    """
    lifetime = None if body.days is None else timedelta(days=body.days)
    with services.database.write() as session:
        text = tokens.create_token(
            session, body.user, body.role, who.course, scopes=body.scopes, lifetime=lifetime, by=who
        )
    return {"token": text}


@router.delete("/tokens/{token_id}", status_code=204, responses=refusals(401, 403, 404, 422, 429))
def revoke_token(token_id: str, who: Instructor, services: AppServices) -> None:
    """Revokes one token by its id, which is the middle part of its text."""
    with services.database.write() as session:
        tokens.revoke(session, token_id, who.course, who)


@router.get("/course", response_model=CourseView, responses=refusals(401, 403, 429))
def show_course(who: Instructor, services: AppServices, request: Request) -> dict[str, Any]:
    """The course, and the link with which learners join it; null while it is closed to them."""
    with services.database.read() as session:
        link = stored_courses.find_link(session, who.course)
    return {"course": who.course, "join_url": None if link is None else join_url(services, request, link.code)}


@router.put("/course/link", response_model=CourseView, responses=refusals(401, 403, 429))
def rotate_course_link(who: Instructor, services: AppServices, request: Request) -> dict[str, Any]:
    """Opens the course to everybody with the new link; an earlier one ends."""
    with services.database.write() as session:
        code = invitations.rotate_link(session, who)
    return {"course": who.course, "join_url": join_url(services, request, code)}


@router.delete("/course/link", status_code=204, responses=refusals(401, 403, 429))
def close_course_link(who: Instructor, services: AppServices) -> None:
    """Ends the link; learners who joined stay."""
    with services.database.write() as session:
        invitations.close_link(session, who)


@router.get("/audit", response_model=Page[AuditView], responses=refusals(401, 403, 422, 429))
def list_audit_entries(query: ListParams, who: Instructor, services: AppServices, response: Response) -> dict[str, Any]:
    """Lists who did what in the course, newest first."""
    before = None if query.cursor is None else query.read_number()
    with services.database.read() as session:
        entries = stored_courses.audit_page(session, who.course, before, query.limit + 1)
        unseen = find_unseen(session, who)
    return build_page([describe_entry(entry, unseen) for entry in entries], query, "/audit", response)


def join_url(services: Services, request: Request, code: str) -> str:
    """The link with which learners join a course."""
    return f"{services.origin_of(request)}/join?code={code}"


def describe_members(session: Session, course: str, members: Sequence[Member]) -> list[dict[str, Any]]:
    """Members as JSON, each with where they come from."""
    launched = platforms.find_courses(session, [member.id for member in members])
    sharing = stored_people.sharing_email(session, course, members)
    return [
        describe_member(member)
        | {
            "platforms": [{"platform": name, "course": title} for name, title in launched.get(member.id, ())],
            "same_email": sharing.get(member.id, []),
        }
        for member in members
    ]


def describe_member(member: Member) -> dict[str, Any]:
    """A member as JSON. `way_in` is name, oidc, lms, lti or browser: how the member is found again."""
    way_in = "browser" if member.account is None else member.account.partition(":")[0]
    shown = {name: getattr(member, name) for name in ("id", "name", "named_by", "role", "created_at", "email")}
    return shown | {"way_in": way_in, "learner": vars(known_as(member))}


def describe_invitation(invitation: Invitation, origin: str) -> dict[str, Any]:
    """A new invitation with its link."""
    return {
        "id": invitation.code.split("_")[1],
        "name": invitation.member.name,
        "member": invitation.member.id,
        "role": invitation.member.role,
        "url": f"{origin}/signin?code={invitation.code}",
        "expires_at": invitation.expires_at,
    }


def describe_entry(entry: AuditEntry, unseen: Unseen) -> dict[str, Any]:
    """An entry of the audit log as JSON, without first marks that are unseen; `id` is text, as everywhere."""
    shown = {name: getattr(entry, name) for name in ("at", "actor", "name", "action", "subject")}
    return {"id": str(entry.id)} | shown | {"detail": limit_detail(entry, unseen)}
