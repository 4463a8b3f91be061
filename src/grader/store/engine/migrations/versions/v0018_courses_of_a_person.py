"""Which member of another course a member belongs to, and from which session a session was opened; who set a name."""

import sqlalchemy as sa
from alembic import op

revision = "0018"
down_revision = "0017"

IS_SET = sa.text("home IS NOT NULL")


def upgrade() -> None:
    """The columns; so far every member belongs to one course, and every name follows where it comes from."""
    op.add_column("members", sa.Column("home", sa.String(32)))
    op.add_column("members", sa.Column("named_by", sa.String(200)))
    op.add_column("credentials", sa.Column("home", sa.String(32)))
    for table in ("members", "credentials"):
        op.create_index(f"ix_{table}_home", table, ["home"], sqlite_where=IS_SET, postgresql_where=IS_SET)


def downgrade() -> None:
    """The tables as they were."""
    for table in ("members", "credentials"):
        op.drop_index(f"ix_{table}_home", table)
    op.drop_column("credentials", "home")
    op.drop_column("members", "named_by")
    op.drop_column("members", "home")
