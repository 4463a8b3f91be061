"""Content by digest, and regrades."""

import sqlalchemy as sa
from alembic import op

revision = "0008"
down_revision = "0007"

TIME = sa.DateTime(timezone=True)
ID = sa.String(32)


def upgrade() -> None:
    """Servers fill the tables of content when they start."""
    create_contents()
    create_regrades()
    create_regrade_items()


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
        sa.Column("course", sa.String(200), primary_key=True),
        sa.Column("quiz", sa.String(64), primary_key=True),
        sa.Column("digest", sa.String(80), nullable=False),
    )


def create_regrades() -> None:
    """Regrades."""
    op.create_table(
        "regrades",
        sa.Column("id", ID, primary_key=True),
        sa.Column("course", sa.String(200), nullable=False),
        sa.Column("quiz", sa.String(64), nullable=False),
        sa.Column("question", sa.String(64)),
        sa.Column("scope", sa.Text, nullable=False),
        sa.Column("dry_run", sa.Boolean, nullable=False),
        sa.Column("content_digest", sa.String(80), nullable=False),
        sa.Column("status", sa.String(20), nullable=False),
        sa.Column("reason", sa.Text),
        sa.Column("counts", sa.Text),
        sa.Column("created_by", sa.String(200), nullable=False),
        sa.Column("created_at", TIME, nullable=False),
        sa.Column("finished_at", TIME),
    )
    op.create_index("ix_regrades_course", "regrades", ["course", "id"])


def create_regrade_items() -> None:
    """What each submission of a regrade came to."""
    op.create_table(
        "regrade_items",
        sa.Column("regrade_id", ID, sa.ForeignKey("regrades.id"), primary_key=True),
        sa.Column("number", sa.Integer, primary_key=True, autoincrement=False),
        sa.Column("place", sa.Integer, nullable=False),
        sa.Column("submission_id", ID, nullable=False),
        sa.Column("learner", ID, nullable=False),
        sa.Column("question", sa.String(64), nullable=False),
        sa.Column("outcome", sa.String(20), nullable=False),
        sa.Column("tries", sa.Integer, nullable=False),
        sa.Column("old_status", sa.String(20)),
        sa.Column("old_points", sa.Float(53)),
        sa.Column("new_status", sa.String(20)),
        sa.Column("new_points", sa.Float(53)),
        sa.Column("counted_before", sa.Float(53)),
        sa.Column("counted_after", sa.Float(53)),
    )
    op.create_index("ix_regrade_items_outcome", "regrade_items", ["regrade_id", "outcome", "number"])
    op.create_index("ix_regrade_items_place", "regrade_items", ["regrade_id", "place"])


def downgrade() -> None:
    """Removes regrades, whose verdicts stay, and the kept content: queued scripts are graded by what is loaded then."""
    op.execute("DELETE FROM jobs WHERE topic = 'regrade'")
    for table in ("regrade_items", "regrades", "content_in_use", "content_manifests", "content_files"):
        op.drop_table(table)
