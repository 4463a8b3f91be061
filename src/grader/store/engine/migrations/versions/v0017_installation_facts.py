"""What commands have to know of the server: the origin at which browsers reach it."""

import sqlalchemy as sa
from alembic import op

revision = "0017"
down_revision = "0016"


def upgrade() -> None:
    """The table; the server writes the origin when it starts."""
    op.create_table(
        "installation_facts",
        sa.Column("name", sa.String(40), primary_key=True),
        sa.Column("value", sa.Text, nullable=False),
    )


def downgrade() -> None:
    """The tables as they were."""
    op.drop_table("installation_facts")
