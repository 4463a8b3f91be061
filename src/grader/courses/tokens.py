"""Bearer tokens: created with scopes and an expiry, listed, revoked."""

from collections.abc import Iterable, Sequence
from datetime import timedelta
from typing import Any

from sqlalchemy.orm import Session

from grader.courses.audit import Action, record
from grader.courses.people import named
from grader.errors import Forbidden, NotFound
from grader.identity import DEFAULT_COURSE, Identity, Kind, Role, checked_role, checked_scopes, issue
from grader.store import credentials, people
from grader.store.tables import Credential, now

DAYS_MAX = 3650
"""The longest life of a token that is not unlimited [days]."""


def create_token(
    session: Session,
    user: str,
    role: Role | str,
    course: str | None = None,
    *,
    scopes: Iterable[str] | None = None,
    lifetime: timedelta | None = None,
    by: Identity | None = None,
) -> str:
    """Creates a bearer token for a named member. Raises Unprocessable, Forbidden.

    Without `scopes` it may do what the role may; without `lifetime` it is valid until it is revoked. A token that
    creates another cannot give it more than its own scopes.
    """
    checked, wanted = checked_role(role), None if scopes is None else checked_scopes(scopes)
    if by is not None and by.scopes is not None and (wanted is None or not wanted <= by.scopes):
        raise Forbidden("A token can give another only the scopes that it has itself.")
    member = named(session, user, checked, course)
    session.flush()
    text = issue(session, Kind.TOKEN, member, checked, lifetime, scopes=wanted, by=by)
    shown = None if wanted is None else sorted(wanted)
    record(session, by, member.course, Action.TOKEN_CREATED, user, role=checked.value, scopes=shown)
    return text


def tokens(session: Session, course: str) -> Sequence[Credential]:
    """The tokens of a course that were not revoked and have not expired, newest first."""
    return credentials.alive_in(session, course, Kind.TOKEN, now())


def revoke(session: Session, token_id: str, course: str, by: Identity | None = None) -> None:
    """Revokes one token by its id. Raises NotFound if it is not one of the course, or has ended."""
    credential = credentials.find(session, token_id, Kind.TOKEN, now())
    if credential is None or credential.course != course:
        raise NotFound("There is no such token.")
    credentials.revoke(session, credential.id, now())
    record(session, by, course, Action.TOKEN_REVOKED, credential.user, token=token_id)


def revoke_all(session: Session, user: str, course: str | None = None) -> int:
    """Revokes every bearer token, session and sign-in code of a named member. Returns how many were valid."""
    member = people.with_account(session, course or DEFAULT_COURSE, f"name:{user}")
    if member is None:
        return 0
    ended = credentials.revoke_all(session, member.id, now())
    record(session, None, member.course, Action.CREDENTIALS_REVOKED, user, count=ended)
    return ended


def shown(credential: Credential) -> dict[str, Any]:
    """A token or a link, without its secret."""
    return {
        "id": credential.id,
        "name": credential.user,
        "member": credential.member,
        "role": credential.role,
        "scopes": None if credential.scopes is None else credential.scopes.split(),
        "created_at": credential.created_at,
        "created_by": credential.created_by,
        "expires_at": credential.expires_at,
        "last_used_at": credential.last_used_at,
    }
