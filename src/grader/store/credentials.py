"""Every query on credentials."""

from collections.abc import Iterable, Sequence
from datetime import datetime
from typing import Any, cast

from sqlalchemy import ColumnElement, CursorResult, bindparam, delete, exists, or_, select, update
from sqlalchemy.orm import Session

from grader.store.engine.bulk import UtcDateTime
from grader.store.tables import Credential, Member

PRUNED_AT_ONCE = 100
"""The most credentials that one call of `prune` deletes, so that no request waits long for it."""


OWNED = exists().where(Member.id == Credential.member, Member.role == Credential.role, Member.removed_at.is_(None))
"""Whether the member of a credential still has its role."""


def is_alive(clock: datetime | ColumnElement[datetime]) -> ColumnElement[bool]:
    """Whether a credential is neither revoked nor expired, and its member is still there and has its role."""
    return Credential.revoked_at.is_(None) & or_(Credential.expires_at.is_(None), Credential.expires_at > clock) & OWNED


CLOCK = bindparam("clock", type_=UtcDateTime)
FIND = select(Credential).where(
    Credential.id == bindparam("wanted"), Credential.kind == bindparam("of_kind"), is_alive(CLOCK)
)
TOUCH = update(Credential).where(Credential.id == bindparam("wanted")).values(last_used_at=CLOCK)
"""Made once: most requests find a credential, and to make a statement takes longer than to execute it."""


def add(session: Session, credential: Credential) -> None:
    """Adds a new credential."""
    session.add(credential)


def find(session: Session, credential_id: str, kind: str, clock: datetime) -> Credential | None:
    """The credential of this kind and id; None if it is revoked or expired, or its member is out or lost the role."""
    return session.scalar(FIND, {"wanted": credential_id, "of_kind": kind, "clock": clock})


def touch(session: Session, credential_id: str, clock: datetime) -> None:
    """Records that the credential was used now."""
    session.connection().execute(TOUCH, {"wanted": credential_id, "clock": clock})


def rename(session: Session, member: str, name: str) -> None:
    """Writes the new name of a member into the credentials that are theirs."""
    theirs = update(Credential).where(Credential.member == member, Credential.user != name)
    session.execute(theirs.values(user=name), execution_options={"synchronize_session": False})


def revoke(session: Session, credential_id: str, clock: datetime) -> bool:
    """Revokes the credential. False if it had ended before: of two calls at once only one gets True."""
    return _revoke(session, clock, Credential.id == credential_id, is_alive(clock)) == 1


def revoke_all(session: Session, member: str, clock: datetime, kinds: Iterable[str] | None = None) -> int:
    """Revokes the credentials of a member, or those of some kinds. Returns how many had not been revoked before."""
    of_kind = () if kinds is None else (Credential.kind.in_(list(kinds)),)
    return _revoke(session, clock, Credential.member == member, Credential.revoked_at.is_(None), *of_kind)


def list_alive(session: Session, course: str, kind: str, clock: datetime) -> Sequence[Credential]:
    """The credentials of one kind in a course that have not ended, newest first."""
    wanted = select(Credential).where(Credential.course == course, Credential.kind == kind, is_alive(clock))
    return session.scalars(wanted.order_by(Credential.created_at.desc(), Credential.id)).all()


def list_alive_of(session: Session, member: str, kind: str, clock: datetime) -> Sequence[Credential]:
    """The credentials of one kind of a member that have not ended, newest first."""
    wanted = select(Credential).where(Credential.member == member, Credential.kind == kind, is_alive(clock))
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


def _revoke(session: Session, clock: datetime, *conditions: ColumnElement[bool]) -> int:
    """Revokes credentials, and the sessions of other courses that were opened from them. Returns how many of the
    former."""
    homes = select(Credential.id).where(*conditions).correlate(None)
    entered = update(Credential).where(Credential.home.in_(homes), Credential.revoked_at.is_(None))
    ended = update(Credential).where(*conditions)
    session.execute(entered.values(revoked_at=clock), execution_options={"synchronize_session": False})
    return cast(CursorResult[Any], session.execute(ended.values(revoked_at=clock))).rowcount
