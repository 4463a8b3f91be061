"""Reviews: claims, and the reviewer of a verdict."""

import sqlalchemy as sa
from alembic import op

revision = "0002"
down_revision = "0001"


def upgrade() -> None:
    """Claims, the reviewer of a verdict, and an index of submissions by status."""
    op.add_column("verdicts", sa.Column("reviewer", sa.String(200)))
    op.create_table(
        "review_claims",
        sa.Column("submission_id", sa.String(32), sa.ForeignKey("submissions.id"), primary_key=True),
        sa.Column("reviewer", sa.String(200), nullable=False),
        sa.Column("expires_at", sa.DateTime(timezone=True), nullable=False),
    )
    op.create_index("ix_submissions_status", "submissions", ["course", "status", "id"])


def downgrade() -> None:
    """Removes claims and the names of reviewers; reviewed verdicts stay."""
    op.drop_index("ix_submissions_status", "submissions")
    op.drop_table("review_claims")
    op.drop_column("verdicts", "reviewer")
