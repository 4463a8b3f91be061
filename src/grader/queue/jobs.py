"""The queue as one table. A job is claimed for a while; whoever still holds the claim may finish it."""

import secrets
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

from sqlalchemy import DateTime, Index, Integer, String, delete, func, or_, select, update
from sqlalchemy.orm import DeclarativeBase, Mapped, Session, mapped_column


class QueueBase(DeclarativeBase):
    """The queue knows no other table; a job names its subject by id."""


class JobRow(QueueBase):
    """One job to do. `lease` is the claim of the worker that runs it, good until `leased_until`."""

    __tablename__ = "jobs"
    __table_args__ = (Index("ix_jobs_due_at", "due_at", "id"),)

    id: Mapped[int] = mapped_column(Integer, primary_key=True)
    topic: Mapped[str] = mapped_column(String(20))
    subject: Mapped[str] = mapped_column(String(64))
    tries: Mapped[int]
    due_at: Mapped[datetime] = mapped_column(DateTime)
    lease: Mapped[str | None] = mapped_column(String(32))
    leased_until: Mapped[datetime | None] = mapped_column(DateTime)


@dataclass(frozen=True)
class Claim:
    """A job that was claimed: what it is about, the how-many-th try this is, and the proof of the claim."""

    job_id: int
    topic: str
    subject: str
    tries: int
    lease: str


def put(session: Session, topic: str, subject: str, delay_s: float = 0.0) -> None:
    """A new job, in the caller's transaction."""
    session.add(JobRow(topic=topic, subject=subject, tries=0, due_at=_clock() + timedelta(seconds=delay_s)))


def claim(session: Session, lease_s: float) -> Claim | None:
    """The oldest job that is due and that nobody holds, for `lease_s` seconds; None where there is none."""
    clock = _clock()
    free = or_(JobRow.leased_until.is_(None), JobRow.leased_until < clock)
    oldest = select(JobRow).where(JobRow.due_at <= clock, free).order_by(JobRow.due_at, JobRow.id).limit(1)
    row = session.scalars(oldest.with_for_update(skip_locked=True)).first()
    if row is None:
        return None
    row.tries += 1
    row.lease = secrets.token_hex(16)
    row.leased_until = clock + timedelta(seconds=lease_s)
    return Claim(row.id, row.topic, row.subject, row.tries, row.lease)


def renew(session: Session, claims: list[Claim], lease_s: float) -> None:
    """The claims hold for another `lease_s` seconds from now, where they still hold."""
    leases = [claimed.lease for claimed in claims]
    until = _clock() + timedelta(seconds=lease_s)
    session.execute(update(JobRow).where(JobRow.lease.in_(leases)).values(leased_until=until))


def finish(session: Session, claimed: Claim) -> bool:
    """The job is done. False where another worker has taken it over: then nothing of this try may be kept."""
    done = delete(JobRow).where(JobRow.id == claimed.job_id, JobRow.lease == claimed.lease).returning(JobRow.id)
    return session.execute(done).first() is not None


def put_back(session: Session, claimed: Claim, delay_s: float, *, tried: bool) -> bool:
    """The job is to be done after `delay_s` seconds; whether this was a try that failed. False as in `finish`."""
    due = _clock() + timedelta(seconds=delay_s)
    again = update(JobRow).where(JobRow.id == claimed.job_id, JobRow.lease == claimed.lease)
    tries = claimed.tries if tried else claimed.tries - 1
    again_set = again.values(lease=None, leased_until=None, due_at=due, tries=tries).returning(JobRow.id)
    return session.execute(again_set).first() is not None


def waiting(session: Session) -> int:
    """How many jobs are not done yet, those that are running included."""
    return session.scalar(select(func.count()).select_from(JobRow)) or 0


def _clock() -> datetime:
    """UTC without a zone: both databases compare it as it is."""
    return datetime.now(UTC).replace(tzinfo=None)
