"""Content by digest, and regrades."""

import sqlalchemy as sa
from alembic import op

revision = "0008"
down_revision = "0006"

TIME = sa.DateTime(timezone=True)
ID = sa.String(32)


def upgrade() -> None:
    """Servers fill the tables of content when they start."""
    create_contents()


def create_contents() -> None:
    """Files by sha256, the files of each digest, and the digests in use."""
    op.create_table(
        "content_files",
        sa.Column("sha256", sa.String(64), primary_key=True),
        sa.Column("body", sa.LargeBinary, nullable=False),
    )
    op.create_table(
        "content_manifests",
        sa.Column("digest", sa.String(80), primary_key=True),
        sa.Column("quiz", sa.String(64), nullable=False),
        sa.Column("files", sa.Text, nullable=False),
        sa.Column("created_at", TIME, nullable=False),
    )
    op.create_table(
        "content_in_use",
        sa.Column("quiz", sa.String(64), primary_key=True),
        sa.Column("digest", sa.String(80), nullable=False),
    )
