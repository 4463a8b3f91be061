"""Results and their feed, extensions, publications, and the indices of lists."""

import sqlalchemy as sa
from alembic import op

revision = "0006"
down_revision = "0005"

TIME = sa.DateTime(timezone=True)
ID = sa.String(32)
NEWEST = "verdicts.submission_id = submissions.id AND verdicts.revision = submissions.revision"


def upgrade() -> None:
    """Results begin empty; `POST .../results:recount` fills them from the verdicts of an older installation."""
    op.add_column("submissions", sa.Column("outcome", sa.String(20)))
    op.execute(f"UPDATE submissions SET outcome = (SELECT status FROM verdicts WHERE {NEWEST})")  # noqa: S608
    op.drop_index("ix_submissions_learner", "submissions")
    op.create_index("ix_submissions_learner", "submissions", ["course", "learner", "id"])
    op.create_index("ix_submissions_quiz", "submissions", ["course", "quiz", "id", "question"])
    create_attempts_index()
    create_results()
    create_result_revisions()
    create_extensions()
    create_publications()


def create_attempts_index() -> None:
    """Counts attempts without reading them. SQLite uses it where a query has the condition word for word."""
    columns = ["course", "learner", "quiz", "question", "id", "outcome"]
    lite, postgres = sa.text("uses_attempt = 1"), sa.text("uses_attempt")
    op.create_index("ix_submissions_attempts", "submissions", columns, sqlite_where=lite, postgresql_where=postgres)


def counted() -> list[sa.Column[object]]:
    """What counts, in a result and in each of its revisions."""
    return [
        sa.Column("submission_id", ID, sa.ForeignKey("submissions.id"), nullable=False),
        sa.Column("attempt", sa.Integer),
        sa.Column("points", sa.Float(53), nullable=False),
        sa.Column("max_points", sa.Float(53), nullable=False),
        sa.Column("is_late", sa.Boolean, nullable=False),
        sa.Column("is_final", sa.Boolean, nullable=False),
        sa.Column("revision", sa.Integer, nullable=False),
    ]


def create_results() -> None:
    """One row per learner and question."""
    op.create_table(
        "results",
        sa.Column("course", sa.String(200), primary_key=True),
        sa.Column("learner", ID, primary_key=True),
        sa.Column("quiz", sa.String(64), primary_key=True),
        sa.Column("question", sa.String(64), primary_key=True),
        *counted(),
        sa.Column("first_status", sa.String(20), nullable=False),
        sa.Column("first_option", sa.Integer),
        sa.Column("first_value", sa.Float(53)),
        sa.Column("diagnoses", sa.Text, nullable=False),
        sa.Column("changes", sa.Integer, nullable=False),
    )
    op.create_index("ix_results_quiz", "results", ["course", "quiz", "learner", "question", "changes"])


def create_result_revisions() -> None:
    """The feed."""
    op.create_table(
        "result_revisions",
        sa.Column("id", sa.BigInteger().with_variant(sa.Integer, "sqlite"), primary_key=True),
        sa.Column("position", sa.BigInteger),
        sa.Column("course", sa.String(200), nullable=False),
        sa.Column("learner", ID, nullable=False),
        sa.Column("quiz", sa.String(64), nullable=False),
        sa.Column("question", sa.String(64), nullable=False),
        *counted(),
        sa.Column("created_at", TIME, nullable=False),
    )
    op.create_index("ix_result_revisions_feed", "result_revisions", ["course", "position"], unique=True)
    new = sa.text("position IS NULL")
    columns = ["course", "id"]
    op.create_index("ix_result_revisions_new", "result_revisions", columns, sqlite_where=new, postgresql_where=new)


def create_extensions() -> None:
    """Extensions for one learner."""
    op.create_table(
        "extensions",
        sa.Column("course", sa.String(200), primary_key=True),
        sa.Column("quiz", sa.String(64), primary_key=True),
        sa.Column("learner", ID, primary_key=True),
        sa.Column("due", TIME),
        sa.Column("until", TIME),
        sa.Column("attempts", sa.Integer, nullable=False),
        sa.Column("granted_by", sa.String(200), nullable=False),
        sa.Column("created_at", TIME, nullable=False),
    )


def create_publications() -> None:
    """Published feedback."""
    op.create_table(
        "publications",
        sa.Column("course", sa.String(200), primary_key=True),
        sa.Column("quiz", sa.String(64), primary_key=True),
        sa.Column("published_by", sa.String(200), nullable=False),
        sa.Column("published_at", TIME, nullable=False),
    )


def downgrade() -> None:
    """Removes results, their feed, extensions and publications: `results:recount` counts results again."""
    for table in ("publications", "extensions", "result_revisions", "results"):
        op.drop_table(table)
    for index in ("attempts", "quiz", "learner"):
        op.drop_index(f"ix_submissions_{index}", "submissions")
    op.create_index("ix_submissions_learner", "submissions", ["course", "learner", "quiz", "question"])
    op.drop_column("submissions", "outcome")
