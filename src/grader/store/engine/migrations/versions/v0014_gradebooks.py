"""An index that holds all that a gradebook sorts by, and all that gradebook.csv holds."""

from alembic import op

revision = "0014"
down_revision = "0013"

NAME, TABLE = "ix_results_quiz", "results"
COLUMNS = ["course", "quiz", "learner", "question", "changes"]


def upgrade() -> None:
    """Sums of points took a look into the table for each result."""
    op.drop_index(NAME, TABLE)
    op.create_index(NAME, TABLE, [*COLUMNS, "points", "is_final"])


def downgrade() -> None:
    """The index as it was."""
    op.drop_index(NAME, TABLE)
    op.create_index(NAME, TABLE, COLUMNS)
