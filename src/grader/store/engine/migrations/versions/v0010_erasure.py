"""The audit log lets the name of an erased member be replaced, and nothing else."""

from alembic import op

revision = "0010"
down_revision = "0009"

REFUSAL = "the audit log is append-only"
SAME = " AND ".join(
    f"COALESCE(NEW.{column}, {none}) = COALESCE(OLD.{column}, {none})"
    for column, none in (("id", "0"), ("course", "''"), ("at", "OLD.at"), ("actor", "''"), ("action", "''"))
)
ERASED = (
    "(NEW.name = OLD.name OR NEW.name LIKE 'erased-%') AND (NEW.subject = OLD.subject OR NEW.subject LIKE 'erased-%') "
    "AND (NEW.detail = OLD.detail OR NEW.detail = '{}')"
)
CHANGES = f"NOT ({SAME} AND {ERASED})"


def upgrade() -> None:
    """Who, when and what stay as they were written; names may become those of erased members."""
    drop_update_trigger()
    if is_sqlite():
        op.execute(
            f"CREATE TRIGGER audit_no_update BEFORE UPDATE ON audit WHEN {CHANGES} "
            f"BEGIN SELECT RAISE(ABORT, '{REFUSAL}'); END"
        )
        return
    act = "FOR EACH ROW {} EXECUTE FUNCTION refuse_audit_change()"
    op.execute(f"CREATE TRIGGER audit_append_only BEFORE DELETE ON audit {act.format('')}")
    op.execute(f"CREATE TRIGGER audit_no_update BEFORE UPDATE ON audit {act.format(f'WHEN ({CHANGES})')}")


def downgrade() -> None:
    """Refuses every change again."""
    drop_update_trigger()
    if is_sqlite():
        op.execute(f"CREATE TRIGGER audit_no_update BEFORE UPDATE ON audit BEGIN SELECT RAISE(ABORT, '{REFUSAL}'); END")
        return
    op.execute("DROP TRIGGER audit_no_update ON audit")
    op.execute(
        "CREATE TRIGGER audit_append_only BEFORE UPDATE OR DELETE ON audit "
        "FOR EACH ROW EXECUTE FUNCTION refuse_audit_change()"
    )


def drop_update_trigger() -> None:
    """Removes the trigger that this revision replaces."""
    op.execute("DROP TRIGGER audit_no_update" if is_sqlite() else "DROP TRIGGER audit_append_only ON audit")


def is_sqlite() -> bool:
    """Whether the migration runs on SQLite."""
    return op.get_bind().dialect.name == "sqlite"
