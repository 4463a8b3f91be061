"""What a device calls itself that its owner gave a token."""

import sqlalchemy as sa
from alembic import op

revision = "0016"
down_revision = "0015"


def upgrade() -> None:
    """The column; earlier tokens belong to no device."""
    op.add_column("credentials", sa.Column("label", sa.String(200)))


def downgrade() -> None:
    """The table as it was."""
    op.drop_column("credentials", "label")
