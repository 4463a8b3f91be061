"""Learning platforms that launch by LTI 1.3, what their launches told, and single-use tickets."""

import sqlalchemy as sa
from alembic import op

revision = "0012"
down_revision = "0011"

MOMENT = sa.DateTime(timezone=True)


def upgrade() -> None:
    """The tables, and the platform of a browser session that a launch has opened."""
    op.add_column("credentials", sa.Column("platform", sa.Integer))
    op.create_table(
        "tickets",
        sa.Column("hash", sa.String(64), primary_key=True),
        sa.Column("purpose", sa.String(20), nullable=False),
        sa.Column("body", sa.Text, nullable=False),
        sa.Column("expires_at", MOMENT, nullable=False),
    )
    op.create_index("ix_tickets_expires_at", "tickets", ["purpose", "expires_at"])
    create_platforms()
    create_contexts()


def create_platforms() -> None:
    """Platforms and their deployments."""
    op.create_table(
        "lti_platforms",
        sa.Column("id", sa.Integer, primary_key=True),
        sa.Column("name", sa.String(200), nullable=False),
        sa.Column("issuer", sa.String(255), nullable=False),
        sa.Column("client_id", sa.String(255), nullable=False),
        *(sa.Column(f"{name}_url", sa.Text, nullable=False) for name in ("login", "token", "keys")),
        sa.Column("token_audience", sa.Text, nullable=False),
        sa.Column("origins", sa.Text, nullable=False),
        sa.Column("created_at", MOMENT, nullable=False),
        sa.Column("approved_at", MOMENT),
        sa.UniqueConstraint("issuer", "client_id", name="uq_lti_platforms_client"),
    )
    op.create_table(
        "lti_deployments",
        sa.Column("platform", sa.Integer, sa.ForeignKey("lti_platforms.id"), primary_key=True),
        sa.Column("deployment_id", sa.String(255), primary_key=True),
        sa.Column("created_at", MOMENT, nullable=False),
        sa.Column("approved_at", MOMENT),
    )


def create_contexts() -> None:
    """The platforms' courses, with their links to this tool and their users."""
    op.create_table(
        "lti_contexts",
        sa.Column("id", sa.Integer, primary_key=True),
        sa.Column("platform", sa.Integer, sa.ForeignKey("lti_platforms.id"), nullable=False),
        sa.Column("deployment_id", sa.String(255), nullable=False),
        sa.Column("context_id", sa.String(255), nullable=False),
        sa.Column("title", sa.String(200), nullable=False),
        *(sa.Column(name, sa.String(200)) for name in ("course", "wanted", "wanted_by")),
        sa.Column("members_url", sa.Text, nullable=False),
        sa.Column("created_at", MOMENT, nullable=False),
        sa.UniqueConstraint("platform", "deployment_id", "context_id", name="uq_lti_contexts_context"),
    )
    op.create_index("ix_lti_contexts_course", "lti_contexts", ["course"])
    op.create_index("ix_lti_contexts_wanted", "lti_contexts", ["wanted"])
    op.create_table(
        "lti_resource_links",
        sa.Column("id", sa.Integer, primary_key=True),
        sa.Column("context", sa.Integer, sa.ForeignKey("lti_contexts.id"), nullable=False),
        sa.Column("link_id", sa.String(255), nullable=False),
        *(sa.Column(name, sa.String(64)) for name in ("quiz", "question")),
        *(sa.Column(name, sa.Text, nullable=False) for name in ("line_item_url", "line_items_url", "scopes")),
        sa.UniqueConstraint("context", "link_id", name="uq_lti_resource_links_link"),
    )
    op.create_index("ix_lti_resource_links_quiz", "lti_resource_links", ["quiz", "context"])
    op.create_table(
        "lti_users",
        sa.Column("context", sa.Integer, sa.ForeignKey("lti_contexts.id"), primary_key=True),
        sa.Column("subject", sa.String(255), primary_key=True),
        sa.Column("member", sa.String(32), sa.ForeignKey("members.id"), nullable=False),
        sa.Column("seen_at", MOMENT, nullable=False),
    )
    op.create_index("ix_lti_users_member", "lti_users", ["member"])


def downgrade() -> None:
    """Removes them. Learners who came from a platform stay members, and get a new account at the next launch."""
    launched = "platform IS NOT NULL AND revoked_at IS NULL"
    op.execute(f"UPDATE credentials SET revoked_at = CURRENT_TIMESTAMP WHERE {launched}")  # noqa: S608
    for table in ("lti_users", "lti_resource_links", "lti_contexts", "lti_deployments", "lti_platforms", "tickets"):
        op.drop_table(table)
    op.drop_column("credentials", "platform")
