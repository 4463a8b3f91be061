"""The tables. Submissions are immutable answers; verdicts are only ever added; the rest is bookkeeping.

submissions ──< verdicts   every grading, regrade and review is one more revision
            ──< events     what happened to a submission, for listeners
            ──< review_claims  who is reviewing it, and until when: one at most
credentials                bearer tokens, browser sessions and one-time sign-in codes
idempotency_keys           which submission a repeated request already made
"""

import secrets
from datetime import UTC, datetime

from sqlalchemy import (
    BigInteger,
    DateTime,
    Dialect,
    Float,
    ForeignKey,
    Index,
    Integer,
    String,
    Text,
    UniqueConstraint,
    insert,
)
from sqlalchemy.orm import DeclarativeBase, Mapped, Session, mapped_column
from sqlalchemy.types import TypeDecorator

NAME = 200
"""Longest name of a user or course [characters]."""


def now() -> datetime:
    """The current time, in UTC."""
    return datetime.now(UTC)


def new_id() -> str:
    """32 hexadecimal digits that cannot be guessed and sort by time: 48 bits of milliseconds, 80 random ones."""
    return f"{int(now().timestamp() * 1000):012x}{secrets.token_hex(10)}"


class UtcDateTime(TypeDecorator[datetime]):
    """An aware datetime in UTC; SQLite itself forgets the zone."""

    impl = DateTime(timezone=True)
    cache_ok = True

    def process_bind_param(self, value: datetime | None, _dialect: Dialect) -> datetime | None:
        """To UTC."""
        return None if value is None else value.astimezone(UTC)

    def process_result_value(self, value: datetime | None, _dialect: Dialect) -> datetime | None:
        """To an aware datetime in UTC."""
        if value is None:
            return None
        return value.replace(tzinfo=UTC) if value.tzinfo is None else value.astimezone(UTC)


class Base(DeclarativeBase):
    """What the tables have in common."""

    type_annotation_map = {datetime: UtcDateTime, float: Float(53)}  # noqa: RUF012


class Submission(Base):
    """One immutable answer to one question, and where its grading stands."""

    __tablename__ = "submissions"
    __table_args__ = (
        Index("ix_submissions_learner", "course", "user", "quiz", "question"),
        Index("ix_submissions_course", "course", "id"),
        Index("ix_submissions_status", "course", "status", "id"),
    )

    id: Mapped[str] = mapped_column(String(32), primary_key=True, default=new_id)
    course: Mapped[str] = mapped_column(String(NAME))
    user: Mapped[str] = mapped_column(String(NAME))
    quiz: Mapped[str] = mapped_column(String(64))
    question: Mapped[str] = mapped_column(String(64))
    answer: Mapped[str] = mapped_column(Text)
    """JSON text, escaped to ASCII: any answer at all can be kept, on any database."""
    seed: Mapped[int | None] = mapped_column(BigInteger)
    """Draws the hidden cases; None where there are none."""
    content_digest: Mapped[str] = mapped_column(String(80))
    """Of the quiz as it stood when the answer came in."""
    status: Mapped[str] = mapped_column(String(20))
    """queued, running, graded or needs_review."""
    attempt: Mapped[int]
    """1 for a learner's first go; an answer that used no attempt leaves its number to the next."""
    uses_attempt: Mapped[bool]
    revision: Mapped[int] = mapped_column(default=0)
    """Of the verdict that counts; 0 while there is none."""
    version: Mapped[int] = mapped_column(Integer)
    """Counts the changes: the ETag."""
    created_at: Mapped[datetime] = mapped_column(default=now)

    __mapper_args__ = {"version_id_col": version}  # noqa: RUF012


class VerdictRow(Base):
    """One revision of what grading said; never changed, never removed."""

    __tablename__ = "verdicts"
    __table_args__ = (UniqueConstraint("submission_id", "revision"),)

    id: Mapped[int] = mapped_column(primary_key=True)
    submission_id: Mapped[str] = mapped_column(ForeignKey("submissions.id"))
    revision: Mapped[int]
    cause: Mapped[str] = mapped_column(String(20))
    """grading, regrade or review."""
    status: Mapped[str] = mapped_column(String(20))
    points: Mapped[float]
    max_points: Mapped[float]
    course: Mapped[str] = mapped_column(String(NAME))
    seed: Mapped[int | None] = mapped_column(BigInteger)
    content_digest: Mapped[str] = mapped_column(String(80))
    body: Mapped[str] = mapped_column(Text)
    """The whole verdict as JSON text."""
    reviewer: Mapped[str | None] = mapped_column(String(NAME))
    """Who decided; None where no person did."""
    created_at: Mapped[datetime] = mapped_column(default=now)


class Event(Base):
    """One thing that happened to a submission; numbered from 1 within it."""

    __tablename__ = "events"

    submission_id: Mapped[str] = mapped_column(ForeignKey("submissions.id"), primary_key=True)
    number: Mapped[int] = mapped_column(primary_key=True, autoincrement=False)
    name: Mapped[str] = mapped_column(String(20))
    created_at: Mapped[datetime] = mapped_column(default=now)


class ReviewClaim(Base):
    """An instructor is reviewing a submission; nobody else may until it expires."""

    __tablename__ = "review_claims"

    submission_id: Mapped[str] = mapped_column(ForeignKey("submissions.id"), primary_key=True)
    reviewer: Mapped[str] = mapped_column(String(NAME))
    expires_at: Mapped[datetime]


class Credential(Base):
    """A bearer token, a browser session or a one-time code, by `kind`; of its secret only the hash is kept."""

    __tablename__ = "credentials"

    id: Mapped[str] = mapped_column(String(32), primary_key=True)
    kind: Mapped[str] = mapped_column(String(10))
    secret_hash: Mapped[str] = mapped_column(String(64))
    user: Mapped[str] = mapped_column(String(NAME))
    role: Mapped[str] = mapped_column(String(20))
    course: Mapped[str] = mapped_column(String(NAME))
    created_at: Mapped[datetime] = mapped_column(default=now)
    expires_at: Mapped[datetime | None]
    revoked_at: Mapped[datetime | None]
    last_used_at: Mapped[datetime | None]


class IdempotencyKey(Base):
    """The submission that a learner's request with this key made."""

    __tablename__ = "idempotency_keys"

    course: Mapped[str] = mapped_column(String(NAME), primary_key=True)
    user: Mapped[str] = mapped_column(String(NAME), primary_key=True)
    key: Mapped[str] = mapped_column(String(255), primary_key=True)
    request_digest: Mapped[str] = mapped_column(String(64))
    submission_id: Mapped[str] = mapped_column(ForeignKey("submissions.id"))
    http_status: Mapped[int]
    created_at: Mapped[datetime] = mapped_column(default=now)


INSERTS = {table.name: insert(table) for table in Base.metadata.sorted_tables}


def insert_row(session: Session, row: Base) -> None:
    """Inserts a row as it is; columns that are not set get their defaults, which the row itself does not learn."""
    table = row.__tablename__
    values = {name: value for name, value in vars(row).items() if not name.startswith("_")}
    session.connection().execute(INSERTS[table], values)
