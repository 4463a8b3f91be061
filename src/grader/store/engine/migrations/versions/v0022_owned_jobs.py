"""The index of jobs' owners has owned jobs alone: SQLite read all that wait by it, and sorted them, for every claim."""

import sqlalchemy as sa
from alembic import op

revision = "0022"
down_revision = "0021"

OWNED = sa.text("owner IS NOT NULL")


def upgrade() -> None:
    """The index without the jobs that wait."""
    op.drop_index("ix_jobs_owner", "jobs")
    op.create_index("ix_jobs_owner", "jobs", ["owner"], sqlite_where=OWNED, postgresql_where=OWNED)


def downgrade() -> None:
    """The index of all jobs."""
    op.drop_index("ix_jobs_owner", "jobs")
    op.create_index("ix_jobs_owner", "jobs", ["owner"])
