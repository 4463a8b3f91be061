"""Jobs in rounds and with priorities, and owners instead of leases with a time."""

from datetime import UTC, datetime

import sqlalchemy as sa
from alembic import op

revision = "0004"
down_revision = "0003"

KEPT = sa.text(
    "INSERT INTO jobs (topic, subject, priority, share, round, tries)"
    ' SELECT old.topic, old.subject, 0, dense_rank() OVER (ORDER BY course, "user"),'
    ' row_number() OVER (PARTITION BY course, "user" ORDER BY old.id) - 1, 0'
    " FROM old_jobs AS old JOIN submissions ON submissions.id = old.subject"
)
"""Jobs that wait at the upgrade keep their learner's turn; their shares get small numbers."""


def upgrade() -> None:
    """Makes the table anew, and moves the waiting jobs to it."""
    op.drop_index("ix_jobs_due_at", "jobs")
    op.rename_table("jobs", "old_jobs")
    op.create_table(
        "jobs",
        sa.Column("id", sa.Integer, primary_key=True),
        sa.Column("topic", sa.String(20), nullable=False),
        sa.Column("subject", sa.String(64), nullable=False),
        sa.Column("priority", sa.Integer, nullable=False),
        sa.Column("share", sa.BigInteger, nullable=False),
        sa.Column("round", sa.Integer, nullable=False),
        sa.Column("tries", sa.Integer, nullable=False),
        sa.Column("owner", sa.Integer),
        sa.Column("lease", sa.String(32)),
        sa.Column("delayed_at", sa.Float(53)),
        sa.Column("due_at", sa.Float(53)),
    )
    op.execute(KEPT)
    op.drop_table("old_jobs")
    waits = sa.text("owner IS NULL")
    order, share = ["priority", "round", "share", "id"], ["share", "priority", "round"]
    op.create_index("ix_jobs_order", "jobs", order, sqlite_where=waits, postgresql_where=waits)
    op.create_index("ix_jobs_share", "jobs", share, sqlite_where=waits, postgresql_where=waits)
    op.create_index("ix_jobs_owner", "jobs", ["owner"])


def downgrade() -> None:
    """Makes the table as it was; every job that is not done is due at once."""
    for index in ("ix_jobs_order", "ix_jobs_share", "ix_jobs_owner"):
        op.drop_index(index, "jobs")
    op.rename_table("jobs", "new_jobs")
    jobs = op.create_table(
        "jobs",
        sa.Column("id", sa.Integer, primary_key=True),
        sa.Column("topic", sa.String(20), nullable=False),
        sa.Column("subject", sa.String(64), nullable=False),
        sa.Column("tries", sa.Integer, nullable=False),
        sa.Column("due_at", sa.DateTime, nullable=False),
        sa.Column("lease", sa.String(32)),
        sa.Column("leased_until", sa.DateTime),
    )
    new = sa.table("new_jobs", sa.column("id"), sa.column("topic"), sa.column("subject"))
    now = sa.literal(datetime.now(UTC).replace(tzinfo=None), sa.DateTime)
    waiting = sa.select(new.c.topic, new.c.subject, sa.literal(0), now).order_by(new.c.id)
    op.execute(jobs.insert().from_select(["topic", "subject", "tries", "due_at"], waiting))
    op.drop_table("new_jobs")
    op.create_index("ix_jobs_due_at", "jobs", ["due_at", "id"])
