"""What courses change in the policies of quizzes: dates, attempts, what counts and what is shown when."""

import sqlalchemy as sa
from alembic import op

revision = "0019"
down_revision = "0018"


def upgrade() -> None:
    """The table; so far the policies of the content are in force."""
    op.create_table(
        "policy_changes",
        sa.Column("course", sa.String(200), primary_key=True),
        sa.Column("quiz", sa.String(64), primary_key=True),
        sa.Column("changes", sa.Text, nullable=False),
        sa.Column("changed_by", sa.String(200), nullable=False),
        sa.Column("changed_at", sa.DateTime(timezone=True), nullable=False),
    )


def downgrade() -> None:
    """The tables as they were."""
    op.drop_table("policy_changes")
