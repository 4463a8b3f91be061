"""Members, identified by an id with 128 random bits and not by name; scopes of tokens, course links, the audit log."""

import re
import secrets

import sqlalchemy as sa
from alembic import op

revision = "0005"
down_revision = "0004"

TIME = sa.DateTime(timezone=True)
ID = sa.String(32)

ANONYMOUS = re.compile(r"learner-[0-9a-f]{6}")
"""The names that the service gave to learners who just opened the page."""

OWNERS = (("submissions", "learner"), ("credentials", "member"), ("idempotency_keys", "learner"))
"""The tables whose rows belong to a member, and the column that says so."""


def upgrade() -> None:
    """The table of members, one for each user of a course, and its ids in all rows."""
    create_members()
    for table, column in OWNERS:
        op.add_column(table, sa.Column(column, ID))
    fill_members()
    require_members()
    create_course_links()
    create_audit()


def create_members() -> None:
    """The members of courses."""
    op.create_table(
        "members",
        sa.Column("id", ID, primary_key=True),
        sa.Column("course", sa.String(200), nullable=False),
        sa.Column("name", sa.String(200), nullable=False),
        sa.Column("account", sa.String(210)),
        sa.Column("role", sa.String(20), nullable=False),
        sa.Column("created_at", TIME, nullable=False),
        sa.Column("removed_at", TIME),
        sa.UniqueConstraint("course", "account", name="uq_members_account"),
    )
    op.create_index("ix_members_name", "members", ["course", "name"])


def fill_members() -> None:
    """Makes one member for each user of a course, and gives it the user's rows."""
    connection = op.get_bind()
    each = " UNION ".join(f'SELECT course, "user" FROM {table}' for table, _ in OWNERS)  # noqa: S608
    add = sa.text(
        "INSERT INTO members (id, course, name, account, role, created_at) "
        "VALUES (:id, :course, :name, :account, :role, CURRENT_TIMESTAMP)"
    )
    for course, name in connection.execute(sa.text(each)).all():
        account = None if is_anonymous(course, name) else f"name:{name}"
        row = {"id": secrets.token_hex(16), "course": course, "name": name, "account": account}
        connection.execute(add, row | {"role": role_of(course, name)})
    for table, column in OWNERS:
        theirs = f'SELECT id FROM members WHERE course = {table}.course AND name = {table}."user"'  # noqa: S608
        connection.execute(sa.text(f"UPDATE {table} SET {column} = ({theirs})"))  # noqa: S608


def is_anonymous(course: str, name: str) -> bool:
    """Whether the service made the name up: it has the form, and no token or sign-in link bears it."""
    given = sa.text("SELECT 1 FROM credentials WHERE course = :course AND \"user\" = :name AND kind <> 'grs'")
    found = op.get_bind().execute(given, {"course": course, "name": name}).first()
    return found is None and ANONYMOUS.fullmatch(name) is not None


def role_of(course: str, name: str) -> str:
    """The highest role of the user's credentials; student without any."""
    roles = sa.text('SELECT DISTINCT role FROM credentials WHERE course = :course AND "user" = :name')
    found = {row[0] for row in op.get_bind().execute(roles, {"course": course, "name": name})}
    return next((role for role in ("instructor", "service") if role in found), "student")


def require_members() -> None:
    """Makes the new columns required, and puts them into keys and indices in place of the name."""
    with op.batch_alter_table("submissions") as table:
        table.alter_column("learner", existing_type=ID, nullable=False)
        table.drop_index("ix_submissions_learner")
        table.create_index("ix_submissions_learner", ["course", "learner", "quiz", "question"])
        table.create_index("ix_submissions_user", ["course", "user", "id"])
    with op.batch_alter_table("credentials") as table:
        table.alter_column("member", existing_type=ID, nullable=False)
        table.create_foreign_key("fk_credentials_member", "members", ["member"], ["id"])
        table.add_column(sa.Column("scopes", sa.Text))
        table.add_column(sa.Column("created_by", sa.String(200)))
        table.create_index("ix_credentials_member", ["member"])
        table.create_index("ix_credentials_course", ["course", "kind"])
        table.create_index("ix_credentials_expires_at", ["kind", "expires_at"])
    key_by_learner()


def key_by_learner() -> None:
    """Makes the learner a part of the key of `idempotency_keys`, in place of the name."""
    op.rename_table("idempotency_keys", "idempotency_keys_by_name")
    op.create_table(
        "idempotency_keys",
        sa.Column("course", sa.String(200), primary_key=True),
        sa.Column("learner", ID, primary_key=True),
        sa.Column("key", sa.String(255), primary_key=True),
        sa.Column("request_digest", sa.String(64), nullable=False),
        sa.Column("submission_id", ID, sa.ForeignKey("submissions.id"), nullable=False),
        sa.Column("http_status", sa.Integer, nullable=False),
        sa.Column("created_at", TIME, nullable=False),
    )
    kept = "course, learner, key, request_digest, submission_id, http_status, created_at"
    op.execute(f"INSERT INTO idempotency_keys ({kept}) SELECT {kept} FROM idempotency_keys_by_name")  # noqa: S608
    op.drop_table("idempotency_keys_by_name")


def create_course_links() -> None:
    """The codes with which learners join courses."""
    op.create_table(
        "course_links",
        sa.Column("course", sa.String(200), primary_key=True),
        sa.Column("code", sa.String(40), nullable=False, unique=True),
        sa.Column("created_at", TIME, nullable=False),
    )


def create_audit() -> None:
    """The audit log; triggers refuse to change or delete its rows."""
    op.create_table(
        "audit",
        sa.Column("id", sa.Integer, primary_key=True),
        sa.Column("course", sa.String(200), nullable=False),
        sa.Column("at", TIME, nullable=False),
        sa.Column("actor", ID),
        sa.Column("name", sa.String(200), nullable=False),
        sa.Column("action", sa.String(40), nullable=False),
        sa.Column("subject", sa.String(200), nullable=False),
        sa.Column("detail", sa.Text, nullable=False),
    )
    op.create_index("ix_audit_course", "audit", ["course", "id"])
    refusal = "the audit log is append-only"
    if op.get_bind().dialect.name == "sqlite":
        for change in ("UPDATE", "DELETE"):
            name = f"audit_no_{change.lower()}"
            op.execute(f"CREATE TRIGGER {name} BEFORE {change} ON audit BEGIN SELECT RAISE(ABORT, '{refusal}'); END")
        return
    op.execute(
        "CREATE FUNCTION refuse_audit_change() RETURNS trigger LANGUAGE plpgsql "
        f"AS $$ BEGIN RAISE EXCEPTION '{refusal}'; END $$"
    )
    op.execute(
        "CREATE TRIGGER audit_append_only BEFORE UPDATE OR DELETE ON audit "
        "FOR EACH ROW EXECUTE FUNCTION refuse_audit_change()"
    )


def downgrade() -> None:
    """Tells learners apart by their names again; those who share one get names that end with their ids."""
    drop_audit()
    op.drop_table("course_links")
    part_namesakes()
    key_by_name()
    with op.batch_alter_table("credentials") as table:
        for index in ("member", "course", "expires_at"):
            table.drop_index(f"ix_credentials_{index}")
        table.drop_constraint("fk_credentials_member", type_="foreignkey")
        for column in ("member", "scopes", "created_by"):
            table.drop_column(column)
    with op.batch_alter_table("submissions") as table:
        table.drop_index("ix_submissions_learner")
        table.drop_index("ix_submissions_user")
        table.drop_column("learner")
        table.create_index("ix_submissions_learner", ["course", "user", "quiz", "question"])
    op.drop_table("members")


def part_namesakes() -> None:
    """Renames members without an account who bear the name of another."""
    shared = "SELECT 1 FROM members AS other WHERE other.course = members.course AND other.name = members.name"
    wanted = f"account IS NULL AND EXISTS ({shared} AND other.id <> members.id)"
    new_name = "substr(name, 1, 160) || '-' || id"
    op.execute(f"UPDATE members SET name = {new_name} WHERE {wanted}")  # noqa: S608
    for table, column in (("submissions", "learner"), ("credentials", "member")):
        name = f"SELECT name FROM members WHERE members.id = {table}.{column}"  # noqa: S608
        op.execute(f'UPDATE {table} SET "user" = COALESCE(({name}), "user")')  # noqa: S608


def key_by_name() -> None:
    """Makes the name a part of the key of `idempotency_keys`, in place of the learner."""
    op.rename_table("idempotency_keys", "idempotency_keys_by_learner")
    op.create_table(
        "idempotency_keys",
        sa.Column("course", sa.String(200), primary_key=True),
        sa.Column("user", sa.String(200), primary_key=True),
        sa.Column("key", sa.String(255), primary_key=True),
        sa.Column("request_digest", sa.String(64), nullable=False),
        sa.Column("submission_id", ID, sa.ForeignKey("submissions.id"), nullable=False),
        sa.Column("http_status", sa.Integer, nullable=False),
        sa.Column("created_at", TIME, nullable=False),
    )
    kept = "course, key, request_digest, submission_id, http_status, created_at"
    name = "COALESCE((SELECT name FROM members WHERE members.id = learner), learner)"
    op.execute(
        f'INSERT INTO idempotency_keys ({kept}, "user") SELECT {kept}, {name} FROM idempotency_keys_by_learner'  # noqa: S608
    )
    op.drop_table("idempotency_keys_by_learner")


def drop_audit() -> None:
    """Removes the audit log with its triggers."""
    op.drop_table("audit")
    if op.get_bind().dialect.name != "sqlite":
        op.execute("DROP FUNCTION refuse_audit_change()")
