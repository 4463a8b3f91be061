"""What a first attempt gave where an answer has several parts: ticked options, numbers of several fields."""

import sqlalchemy as sa
from alembic import op

revision = "0015"
down_revision = "0014"


def upgrade() -> None:
    """The column; earlier answers have one part."""
    op.add_column("results", sa.Column("first_several", sa.Text))


def downgrade() -> None:
    """The table as it was."""
    op.drop_column("results", "first_several")
