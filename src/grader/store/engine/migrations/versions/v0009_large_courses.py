"""Indices for lists by question alone, and for pruning by age."""

from alembic import op

revision = "0009"
down_revision = "0008"


def upgrade() -> None:
    """A list by a question that nobody answered walked all submissions of the course."""
    op.create_index("ix_submissions_question", "submissions", ["course", "question", "id"])
    op.create_index("ix_idempotency_keys_created_at", "idempotency_keys", ["created_at"])


def downgrade() -> None:
    """Drops both indices."""
    op.drop_index("ix_idempotency_keys_created_at", "idempotency_keys")
    op.drop_index("ix_submissions_question", "submissions")
