"""The outbox: destinations, what has to be delivered to them, and the line items of platforms."""

import sqlalchemy as sa
from alembic import op

revision = "0011"
down_revision = "0010"

TIME = sa.DateTime(timezone=True)
ID = sa.String(32)
KEY = sa.BigInteger().with_variant(sa.Integer, "sqlite")


def upgrade() -> None:
    """No destination is there yet, and so nothing has to be delivered."""
    create_destinations()
    create_outbox()
    op.create_table(
        "line_items",
        sa.Column("id", ID, primary_key=True),
        sa.Column("container", sa.Text, nullable=False),
        sa.Column("resource", sa.Text, nullable=False),
        sa.Column("url", sa.Text),
        sa.Column("leased_until", TIME),
    )


def create_destinations() -> None:
    """Webhooks and platforms."""
    op.create_table(
        "destinations",
        sa.Column("id", ID, primary_key=True),
        sa.Column("course", sa.String(200), nullable=False),
        sa.Column("kind", sa.String(10), nullable=False),
        sa.Column("quiz", sa.String(64), nullable=False),
        sa.Column("question", sa.String(64), nullable=False),
        sa.Column("url", sa.Text),
        sa.Column("secret", sa.String(80)),
        sa.Column("old_secret", sa.String(80)),
        sa.Column("old_until", TIME),
        sa.Column("created_by", sa.String(200), nullable=False),
        sa.Column("created_at", TIME, nullable=False),
        sa.Column("disabled_at", TIME),
        sa.Column("why_disabled", sa.Text),
    )
    op.create_index("ix_destinations_course", "destinations", ["course", "id"])


def create_outbox() -> None:
    """A row for each destination and learner."""
    op.create_table(
        "outbox",
        sa.Column("id", KEY, primary_key=True),
        sa.Column("destination", ID, sa.ForeignKey("destinations.id"), nullable=False),
        sa.Column("course", sa.String(200), nullable=False),
        sa.Column("learner", ID, nullable=False),
        sa.Column("quiz", sa.String(64), nullable=False),
        sa.Column("question", sa.String(64), nullable=False),
        sa.Column("state", sa.String(10), nullable=False),
        sa.Column("version", sa.Integer, nullable=False),
        sa.Column("noted_at", TIME, nullable=False),
        sa.Column("has_job", sa.Boolean, nullable=False),
        sa.Column("attempts", sa.Integer, nullable=False),
        sa.Column("next_at", TIME),
        sa.Column("sent_at", TIME),
        sa.Column("error", sa.Text),
        sa.Column("timestamp", TIME),
        sa.Column("sent", sa.Text),
        sa.Column("tried", sa.Text),
        sa.Column("forced", sa.Boolean, nullable=False),
        sa.UniqueConstraint("destination", "learner", "quiz", "question", name="uq_outbox"),
    )
    op.create_index("ix_outbox_course", "outbox", ["course", "state", "id"])
    op.create_index("ix_outbox_learner", "outbox", ["course", "learner"])
    not_sent = sa.text("state <> 'sent'")
    op.create_index("ix_outbox_open", "outbox", ["state"], sqlite_where=not_sent, postgresql_where=not_sent)


def downgrade() -> None:
    """Removes the outbox with what it holds: results go nowhere any more."""
    op.execute("DELETE FROM jobs WHERE topic = 'deliver'")
    for table in ("line_items", "outbox", "destinations"):
        op.drop_table(table)
