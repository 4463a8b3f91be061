"""Every query on credentials."""

from collections.abc import Iterable, Sequence
from datetime import datetime
from typing import Any, cast

from sqlalchemy import ColumnElement, CursorResult, delete, or_, select, update
from sqlalchemy.orm import Session

from grader.store.tables import Credential

PRUNED_AT_ONCE = 100
"""The most credentials that one call of `prune` deletes, so that no request waits long for it."""


def add(session: Session, credential: Credential) -> None:
    """Adds a new credential."""
    session.add(credential)


def find(session: Session, credential_id: str, kind: str, clock: datetime) -> Credential | None:
    """The credential of this kind and id; None if it is revoked or expired."""
    credential = session.get(Credential, credential_id)
    if credential is None or credential.kind != kind or credential.revoked_at is not None:
        return None
    if credential.expires_at is not None and credential.expires_at <= clock:
        return None
    return credential


def touch(session: Session, credential_id: str, clock: datetime) -> None:
    """Records that the credential was used now."""
    session.execute(update(Credential).where(Credential.id == credential_id).values(last_used_at=clock))


def revoke(session: Session, credential_id: str, clock: datetime) -> bool:
    """Revokes the credential. False if it had ended before: of two calls at once only one gets True."""
    return _revoke(session, clock, Credential.id == credential_id, _alive(clock)) == 1


def revoke_all(session: Session, member: str, clock: datetime, kinds: Iterable[str] | None = None) -> int:
    """Revokes the credentials of a member, or those of some kinds. Returns how many had not been revoked before."""
    of_kind = () if kinds is None else (Credential.kind.in_(list(kinds)),)
    return _revoke(session, clock, Credential.member == member, Credential.revoked_at.is_(None), *of_kind)


def alive_in(session: Session, course: str, kind: str, clock: datetime) -> Sequence[Credential]:
    """The credentials of one kind in a course that have not ended, newest first."""
    wanted = select(Credential).where(Credential.course == course, Credential.kind == kind, _alive(clock))
    return session.scalars(wanted.order_by(Credential.created_at.desc(), Credential.id)).all()


def prune(session: Session, kinds: Iterable[str], clock: datetime) -> list[str]:
    """Deletes some credentials of these kinds that had ended at `clock`. Returns the id of the member of each."""
    ended = or_(Credential.expires_at <= clock, Credential.revoked_at <= clock)
    oldest = select(Credential.id, Credential.member).where(Credential.kind.in_(list(kinds)), ended)
    rows = session.execute(oldest.limit(PRUNED_AT_ONCE)).all()
    if rows:
        gone = delete(Credential).where(Credential.id.in_([row[0] for row in rows]))
        session.execute(gone.execution_options(synchronize_session=False))
    return [row[1] for row in rows]


def _alive(clock: datetime) -> ColumnElement[bool]:
    return Credential.revoked_at.is_(None) & or_(Credential.expires_at.is_(None), Credential.expires_at > clock)


def _revoke(session: Session, clock: datetime, *conditions: ColumnElement[bool]) -> int:
    ended = update(Credential).where(*conditions).values(revoked_at=clock)
    return cast(CursorResult[Any], session.execute(ended)).rowcount
