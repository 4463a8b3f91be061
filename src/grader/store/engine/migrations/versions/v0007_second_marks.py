"""Claims by the reviewer's id, second marks, the rubric behind a review, and saved comments."""

import sqlalchemy as sa
from alembic import op

revision = "0007"
down_revision = "0006"

TIME = sa.DateTime(timezone=True)
ID = sa.String(32)


def upgrade() -> None:
    """Claims of before are dropped: they name a reviewer who cannot be told from another, and last minutes."""
    op.drop_table("review_claims")
    op.create_table(
        "review_claims",
        sa.Column("submission_id", ID, sa.ForeignKey("submissions.id"), primary_key=True),
        sa.Column("reviewer", ID, nullable=False),
        sa.Column("name", sa.String(200), nullable=False),
        sa.Column("expires_at", TIME, nullable=False),
    )
    create_reviews()
    create_saved_comments()


def create_reviews() -> None:
    """Who decided, by which rubric, and the second mark."""
    op.create_table(
        "reviews",
        sa.Column("submission_id", ID, sa.ForeignKey("submissions.id"), primary_key=True),
        sa.Column("course", sa.String(200), nullable=False),
        sa.Column("quiz", sa.String(64), nullable=False),
        sa.Column("question", sa.String(64), nullable=False),
        sa.Column("reviewer", ID, nullable=False),
        sa.Column("name", sa.String(200), nullable=False),
        sa.Column("points", sa.Float(53), nullable=False),
        sa.Column("rubric", ID),
        sa.Column("second", sa.String(10), nullable=False),
        sa.Column("second_reviewer", ID),
        sa.Column("second_name", sa.String(200)),
        sa.Column("second_points", sa.Float(53)),
        sa.Column("second_ticked", sa.Text),
        sa.Column("second_comment", sa.Text),
    )
    op.create_index("ix_reviews_rubric", "reviews", ["quiz", "question", "rubric"])
    op.create_index("ix_reviews_second", "reviews", ["course", "second", "submission_id"])


def create_saved_comments() -> None:
    """Texts that reviewers use again."""
    op.create_table(
        "saved_comments",
        sa.Column("id", ID, primary_key=True),
        sa.Column("course", sa.String(200), nullable=False),
        sa.Column("quiz", sa.String(64), nullable=False),
        sa.Column("question", sa.String(64), nullable=False),
        sa.Column("text", sa.Text, nullable=False),
        sa.Column("saved_by", sa.String(200), nullable=False),
        sa.Column("saved_at", TIME, nullable=False),
    )
    op.create_index("ix_saved_comments_question", "saved_comments", ["course", "quiz", "question", "id"])


def downgrade() -> None:
    """Removes second marks and saved comments; verdicts stay. Claims are dropped: they last minutes."""
    for table in ("saved_comments", "reviews", "review_claims"):
        op.drop_table(table)
    op.create_table(
        "review_claims",
        sa.Column("submission_id", ID, sa.ForeignKey("submissions.id"), primary_key=True),
        sa.Column("reviewer", sa.String(200), nullable=False),
        sa.Column("expires_at", TIME, nullable=False),
    )
