"""Single-use secrets that expire: LTI logins in progress, forms of a launch, links of registration, devices that wait
for a token."""

import hashlib
import json
import secrets
from datetime import datetime, timedelta
from typing import Any, cast

from sqlalchemy import CursorResult, Index, String, Text, delete, func, select
from sqlalchemy.orm import Mapped, Session, mapped_column

from grader.store.tables import Base, now

TICKETS_MAX = 20_000
"""Tickets of one purpose that are kept. A stranger can make logins begin: the oldest give way."""

PRUNED_AT_ONCE = 100
UNCHANGED = {"synchronize_session": False}


class Ticket(Base):
    """What is known of a secret until it is used, or expires. Only the secret's hash is stored."""

    __tablename__ = "tickets"
    __table_args__ = (Index("ix_tickets_expires_at", "purpose", "expires_at"),)

    hash: Mapped[str] = mapped_column(String(64), primary_key=True)
    purpose: Mapped[str] = mapped_column(String(20))
    body: Mapped[str] = mapped_column(Text)
    """JSON text."""
    expires_at: Mapped[datetime]


def hash_secret(secret: str) -> str:
    """The sha256 of a secret, as it is stored."""
    return hashlib.sha256(secret.encode(errors="surrogatepass")).hexdigest()


def issue(session: Session, purpose: str, body: dict[str, Any], lifetime: timedelta, secret: str | None = None) -> str:
    """Stores a new ticket and returns its secret, of 256 bits unless another is given; drops expired ones, and the
    oldest of too many."""
    secret = secret or secrets.token_urlsafe(32)
    _make_room(session, purpose)
    session.add(Ticket(hash=hash_secret(secret), purpose=purpose, body=json.dumps(body), expires_at=now() + lifetime))
    session.flush()
    return secret


def peek(session: Session, purpose: str, secret: str) -> dict[str, Any] | None:
    """What a ticket says; it stays valid. None if it is unknown, used or expired."""
    ticket = session.get(Ticket, hash_secret(secret))
    if ticket is None or ticket.purpose != purpose or ticket.expires_at <= now():
        return None
    body: dict[str, Any] = json.loads(ticket.body)
    return body


def change(session: Session, purpose: str, secret_hash: str, **more: Any) -> bool:
    """Changes what a ticket says. False if it is used, expired or unknown."""
    ticket = session.get(Ticket, secret_hash, with_for_update=True)
    if ticket is None or ticket.purpose != purpose or ticket.expires_at <= now():
        return False
    ticket.body = json.dumps(json.loads(ticket.body) | more)
    return True


def take(session: Session, purpose: str, secret: str) -> dict[str, Any] | None:
    """As `peek`, and uses the ticket: of two calls at once only one gets it."""
    body = peek(session, purpose, secret)
    used = delete(Ticket).where(Ticket.hash == hash_secret(secret), Ticket.purpose == purpose)
    gone = cast(CursorResult[Any], session.execute(used, execution_options=UNCHANGED))
    return body if gone.rowcount == 1 else None


def _make_room(session: Session, purpose: str) -> None:
    old = select(Ticket.hash).where(Ticket.purpose == purpose).order_by(Ticket.expires_at)
    _drop(session, old.where(Ticket.expires_at <= now()).limit(PRUNED_AT_ONCE))
    count = session.scalar(select(func.count()).where(Ticket.purpose == purpose)) or 0
    if count >= TICKETS_MAX:
        _drop(session, old.limit(PRUNED_AT_ONCE))


def _drop(session: Session, hashes: Any) -> None:
    gone = session.scalars(hashes).all()
    if gone:
        session.execute(delete(Ticket).where(Ticket.hash.in_(gone)), execution_options=UNCHANGED)
