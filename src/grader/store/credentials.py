"""Every query on credentials."""

from datetime import datetime
from typing import Any, cast

from sqlalchemy import CursorResult, or_, update
from sqlalchemy.orm import Session

from grader.store.tables import Credential


def add(session: Session, credential: Credential) -> None:
    """Keeps a new credential."""
    session.add(credential)


def find(session: Session, credential_id: str, kind: str, clock: datetime) -> Credential | None:
    """The credential of this kind, where it is neither revoked nor expired."""
    credential = session.get(Credential, credential_id)
    if credential is None or credential.kind != kind or credential.revoked_at is not None:
        return None
    if credential.expires_at is not None and credential.expires_at <= clock:
        return None
    return credential


def touch(session: Session, credential_id: str, clock: datetime) -> None:
    """The credential was used just now."""
    session.execute(update(Credential).where(Credential.id == credential_id).values(last_used_at=clock))


def revoke(session: Session, credential_id: str, clock: datetime) -> bool:
    """The credential ends now. False where it had ended before: of two at once only one gets True."""
    alive = Credential.revoked_at.is_(None) & or_(Credential.expires_at.is_(None), Credential.expires_at > clock)
    ended = update(Credential).where(Credential.id == credential_id, alive).values(revoked_at=clock)
    return cast(CursorResult[Any], session.execute(ended)).rowcount == 1


def revoke_all(session: Session, user: str, course: str, clock: datetime) -> int:
    """Every credential of a user in a course ends now; how many had not ended before."""
    theirs = (Credential.user == user, Credential.course == course, Credential.revoked_at.is_(None))
    ended = update(Credential).where(*theirs).values(revoked_at=clock)
    return cast(CursorResult[Any], session.execute(ended)).rowcount
