"""Fewer indices of submissions: each is written with every answer."""

import sqlalchemy as sa
from alembic import op

revision = "0021"
down_revision = "0020"

ATTEMPTS = ["course", "learner", "quiz", "question", "id", "outcome"]
UNSETTLED = sa.text("status <> 'graded'")


def upgrade() -> None:
    """The index of attempts has all of a learner's submissions, that of names is left to the members, and nothing looks
    for graded answers by their status."""
    for name in ("attempts", "learner", "user", "status"):
        op.drop_index(f"ix_submissions_{name}", "submissions")
    op.create_index("ix_submissions_attempts", "submissions", [*ATTEMPTS, "uses_attempt"])
    status = ["course", "status", "id"]
    op.create_index(
        "ix_submissions_unsettled", "submissions", status, sqlite_where=UNSETTLED, postgresql_where=UNSETTLED
    )


def downgrade() -> None:
    """The indices as they were."""
    op.drop_index("ix_submissions_unsettled", "submissions")
    op.drop_index("ix_submissions_attempts", "submissions")
    lite, postgres = sa.text("uses_attempt = 1"), sa.text("uses_attempt")
    op.create_index("ix_submissions_attempts", "submissions", ATTEMPTS, sqlite_where=lite, postgresql_where=postgres)
    op.create_index("ix_submissions_learner", "submissions", ["course", "learner", "id"])
    op.create_index("ix_submissions_user", "submissions", ["course", "user", "id"])
    op.create_index("ix_submissions_status", "submissions", ["course", "status", "id"])
