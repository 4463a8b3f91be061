"""Bearer tokens: created with scopes and an expiry, listed, revoked."""

from collections.abc import Iterable, Sequence
from datetime import timedelta
from typing import Any

from sqlalchemy.orm import Session

from grader.courses.people.audit import Action, record
from grader.courses.people.identity import (
    DEFAULT_COURSE,
    CredentialKind,
    Identity,
    Role,
    Scope,
    check_role,
    check_scopes,
    issue,
)
from grader.courses.people.members import get_meant, other_roles, require_credential, require_reach
from grader.errors import Conflict, Forbidden, NotFound
from grader.store import credentials, people
from grader.store.tables import Credential, now

DAYS_MAX = 3650
"""The longest life of a token that is not unlimited [days]."""


def create_token(
    session: Session, user: str, role: Role | str, course: str | None = None, *,
    scopes: Iterable[str] | None = None, lifetime: timedelta | None = None, by: Identity | None = None,
) -> str:  # fmt: skip
    """Creates a bearer token for a member, by name or id. Raises Unprocessable, Forbidden, Unauthorized, Conflict.
    Without `scopes` it may do what the role may; without `lifetime` it is valid until it is revoked. A restricted token
    creates tokens of students alone, within its own scopes and its own time."""
    checked, wanted = check_role(role), None if scopes is None else check_scopes(scopes)
    if by is not None and by.scopes is not None:
        require_within(session, by, by.scopes, wanted, lifetime)
    require_credential(session, by)
    require_reach(by, checked)
    member = get_meant(session, user, checked, course, by=by)
    if member.role != checked:
        raise Conflict(other_roles([member]))
    session.flush()
    text = issue(session, CredentialKind.TOKEN, member, lifetime, scopes=wanted, by=by)
    shown = None if wanted is None else sorted(wanted)
    record(session, by, member.course, Action.TOKEN_CREATED, member.name, role=checked.value, scopes=shown)
    return text


def require_within(
    session: Session, by: Identity, own: frozenset[Scope], wanted: frozenset[Scope] | None, lifetime: timedelta | None
) -> None:
    """Raises Forbidden if a token would outdo the restricted one that creates it, in scopes or in time."""
    if wanted is None or not wanted <= own:
        raise Forbidden("A token can give another only the scopes that it has itself.")
    credential = credentials.find(session, by.credential, CredentialKind.TOKEN, now())
    ends = None if credential is None else credential.expires_at
    if ends is not None and (lifetime is None or now() + lifetime > ends):
        raise Forbidden(f"A token can give another only the time that it has itself: until {ends:%Y-%m-%d %H:%M} UTC.")


def list_tokens(session: Session, course: str) -> Sequence[Credential]:
    """Returns the tokens of a course that were not revoked and have not expired, newest first."""
    return credentials.list_alive(session, course, CredentialKind.TOKEN, now())


def revoke(session: Session, token_id: str, course: str, by: Identity | None = None) -> None:
    """Revokes one token by its id; a restricted token ends those of students and itself. Raises NotFound if it is not
    one of the course, or has ended; Forbidden, Unauthorized."""
    credential = credentials.find(session, token_id, CredentialKind.TOKEN, now())
    if credential is None or credential.course != course:
        raise NotFound("There is no such token.")
    require_credential(session, by)
    if by is None or credential.id != by.credential:
        require_reach(by, credential.role)
    credentials.revoke(session, credential.id, now())
    record(session, by, course, Action.TOKEN_REVOKED, credential.user, token=token_id)


def revoke_all(session: Session, user: str, course: str | None = None) -> int:
    """Revokes every bearer token, session and sign-in code of a named member. Returns how many were valid."""
    member = people.find_with_account(session, course or DEFAULT_COURSE, f"name:{user}")
    if member is None:
        return 0
    ended = credentials.revoke_all(session, member.id, now())
    record(session, None, member.course, Action.CREDENTIALS_REVOKED, user, count=ended)
    return ended


def describe_credential(credential: Credential) -> dict[str, Any]:
    """Returns a token or a link, without its secret."""
    names = ("id", "member", "role", "label", "created_at", "created_by", "expires_at", "last_used_at")
    return {name: getattr(credential, name) for name in names} | {
        "name": credential.user,
        "scopes": None if credential.scopes is None else credential.scopes.split(),
    }
