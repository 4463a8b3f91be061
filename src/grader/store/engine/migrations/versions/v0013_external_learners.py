"""Members whom another system knows by an id of its own, and addresses of members."""

import sqlalchemy as sa
from alembic import op

revision = "0013"
down_revision = "0012"

COLUMNS = {"namespace": 64, "external_id": 255, "email": 254}


def upgrade() -> None:
    """Adds the columns, empty for all who are members already."""
    for name, characters in COLUMNS.items():
        op.add_column("members", sa.Column(name, sa.String(characters)))


def downgrade() -> None:
    """Drops the columns. The members stay, and are found again by their accounts after another upgrade."""
    for name in COLUMNS:
        op.drop_column("members", name)
