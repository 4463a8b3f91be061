"""Submissions, verdicts, events, credentials, idempotency keys and jobs."""

import sqlalchemy as sa
from alembic import op

revision = "0001"
down_revision = None

TIME = sa.DateTime(timezone=True)


def upgrade() -> None:
    """The first tables."""
    create_submissions()
    create_verdicts()
    create_events()
    create_credentials()
    create_idempotency_keys()
    create_jobs()


def create_submissions() -> None:
    """Immutable answers."""
    op.create_table(
        "submissions",
        sa.Column("id", sa.String(32), primary_key=True),
        sa.Column("course", sa.String(200), nullable=False),
        sa.Column("user", sa.String(200), nullable=False),
        sa.Column("quiz", sa.String(64), nullable=False),
        sa.Column("question", sa.String(64), nullable=False),
        sa.Column("answer", sa.Text, nullable=False),
        sa.Column("seed", sa.BigInteger),
        sa.Column("content_digest", sa.String(80), nullable=False),
        sa.Column("status", sa.String(20), nullable=False),
        sa.Column("attempt", sa.Integer, nullable=False),
        sa.Column("uses_attempt", sa.Boolean, nullable=False),
        sa.Column("revision", sa.Integer, nullable=False),
        sa.Column("version", sa.Integer, nullable=False),
        sa.Column("created_at", TIME, nullable=False),
    )
    op.create_index("ix_submissions_learner", "submissions", ["course", "user", "quiz", "question"])
    op.create_index("ix_submissions_course", "submissions", ["course", "id"])


def create_verdicts() -> None:
    """Verdicts, one row per revision."""
    op.create_table(
        "verdicts",
        sa.Column("id", sa.Integer, primary_key=True),
        sa.Column("submission_id", sa.String(32), sa.ForeignKey("submissions.id"), nullable=False),
        sa.Column("revision", sa.Integer, nullable=False),
        sa.Column("cause", sa.String(20), nullable=False),
        sa.Column("status", sa.String(20), nullable=False),
        sa.Column("points", sa.Float(53), nullable=False),
        sa.Column("max_points", sa.Float(53), nullable=False),
        sa.Column("course", sa.String(200), nullable=False),
        sa.Column("seed", sa.BigInteger),
        sa.Column("content_digest", sa.String(80), nullable=False),
        sa.Column("body", sa.Text, nullable=False),
        sa.Column("created_at", TIME, nullable=False),
        sa.UniqueConstraint("submission_id", "revision"),
    )


def create_events() -> None:
    """Changes of a submission's status."""
    op.create_table(
        "events",
        sa.Column("submission_id", sa.String(32), sa.ForeignKey("submissions.id"), primary_key=True),
        sa.Column("number", sa.Integer, primary_key=True, autoincrement=False),
        sa.Column("name", sa.String(20), nullable=False),
        sa.Column("created_at", TIME, nullable=False),
    )


def create_credentials() -> None:
    """Tokens, sessions and sign-in codes."""
    op.create_table(
        "credentials",
        sa.Column("id", sa.String(32), primary_key=True),
        sa.Column("kind", sa.String(10), nullable=False),
        sa.Column("secret_hash", sa.String(64), nullable=False),
        sa.Column("user", sa.String(200), nullable=False),
        sa.Column("role", sa.String(20), nullable=False),
        sa.Column("course", sa.String(200), nullable=False),
        sa.Column("created_at", TIME, nullable=False),
        sa.Column("expires_at", TIME),
        sa.Column("revoked_at", TIME),
        sa.Column("last_used_at", TIME),
    )


def create_idempotency_keys() -> None:
    """Keys of requests that must not run twice."""
    op.create_table(
        "idempotency_keys",
        sa.Column("course", sa.String(200), primary_key=True),
        sa.Column("user", sa.String(200), primary_key=True),
        sa.Column("key", sa.String(255), primary_key=True),
        sa.Column("request_digest", sa.String(64), nullable=False),
        sa.Column("submission_id", sa.String(32), sa.ForeignKey("submissions.id"), nullable=False),
        sa.Column("http_status", sa.Integer, nullable=False),
        sa.Column("created_at", TIME, nullable=False),
    )


def create_jobs() -> None:
    """The queue. Its times are UTC without a zone."""
    op.create_table(
        "jobs",
        sa.Column("id", sa.Integer, primary_key=True),
        sa.Column("topic", sa.String(20), nullable=False),
        sa.Column("subject", sa.String(64), nullable=False),
        sa.Column("tries", sa.Integer, nullable=False),
        sa.Column("due_at", sa.DateTime, nullable=False),
        sa.Column("lease", sa.String(32)),
        sa.Column("leased_until", sa.DateTime),
    )
    op.create_index("ix_jobs_due_at", "jobs", ["due_at", "id"])


def downgrade() -> None:
    """Removes everything."""
    for table in ("jobs", "idempotency_keys", "credentials", "events", "verdicts", "submissions"):
        op.drop_table(table)
