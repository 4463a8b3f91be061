"""What instructors write to lines of scripts, and the changed copies of scripts that they run."""

import sqlalchemy as sa
from alembic import op

revision = "0020"
down_revision = "0019"


def upgrade() -> None:
    """Both tables, empty."""
    op.create_table(
        "line_comments",
        sa.Column("id", sa.String(32), primary_key=True),
        sa.Column("course", sa.String(200), nullable=False),
        sa.Column("submission_id", sa.String(32), sa.ForeignKey("submissions.id"), nullable=False),
        sa.Column("line", sa.Integer),
        sa.Column("text", sa.Text, nullable=False),
        sa.Column("author", sa.String(32), nullable=False),
        sa.Column("name", sa.String(200), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
    )
    op.create_index("ix_line_comments_submission", "line_comments", ["submission_id", "id"])
    op.create_table(
        "tried_copies",
        sa.Column("submission_id", sa.String(32), sa.ForeignKey("submissions.id"), primary_key=True),
        sa.Column("original", sa.String(32), sa.ForeignKey("submissions.id"), nullable=False),
    )
    op.create_index("ix_tried_copies_original", "tried_copies", ["original"])


def downgrade() -> None:
    """The tables as they were."""
    op.drop_table("tried_copies")
    op.drop_table("line_comments")
