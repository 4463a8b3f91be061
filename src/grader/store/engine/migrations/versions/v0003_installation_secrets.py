"""Secrets of the installation."""

import sqlalchemy as sa
from alembic import op

revision = "0003"
down_revision = "0002"


def upgrade() -> None:
    """The table; `store.installation` makes the secrets."""
    op.create_table(
        "installation_secrets",
        sa.Column("name", sa.String(40), primary_key=True),
        sa.Column("value", sa.LargeBinary, nullable=False),
    )


def downgrade() -> None:
    """Removes the secrets: the seeds of later submissions are drawn with another."""
    op.drop_table("installation_secrets")
