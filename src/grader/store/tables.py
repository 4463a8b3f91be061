"""The tables. Submissions are immutable answers; verdicts are added, never changed.

submissions ──< verdicts   one revision for each grading, regrade and review
            ──< events     what happened to a submission, for listeners
            ──< review_claims  the reviewer who holds it, at most one
            ──< reviews        who decided, by which rubric, and the second mark, at most one
            ──< results        what counts for a learner at a question
results     ──< result_revisions  every change of a result: the feed
extensions                 what one learner gets beyond the policy of a quiz
publications               quizzes whose feedback an instructor has published
members     ──< credentials  bearer tokens, browser sessions and one-time sign-in codes
            ──< submissions, results and extensions by `learner`, without a foreign key: they outlive the members
saved_comments             texts that the reviewers of a question use again
idempotency_keys           the submission that a request with this key made
installation_secrets       keys of the installation, never shown
installation_facts         what commands have to know of the server
lti_*                      learning platforms, in platforms.py
tickets                    single-use secrets that expire, in tickets.py
"""

from datetime import UTC, datetime

from sqlalchemy import BigInteger, Float, ForeignKey, Index, Integer, String, Text, UniqueConstraint, text
from sqlalchemy.orm import DeclarativeBase, Mapped, mapped_column

from grader.store.engine.bulk import UtcDateTime
from grader.store.engine.ids import make_id, make_member_id

ERASED = ""
"""The answer of an erased submission: no JSON text, so that it is not graded again."""

NAME = 200
"""Longest name of a user or course [characters]."""

NAMESPACE, EXTERNAL_ID, EMAIL = 64, 255, 254
"""Longest name of another system, id of a person in it, and address [characters]. Source: LTI 1.3; RFC 5321."""


def now() -> datetime:
    """The current time, in UTC."""
    return datetime.now(UTC)


ROW_ID_MAX = 2**63 - 1
"""The largest number that both databases can look for."""


class Base(DeclarativeBase):
    """The base of the tables."""

    type_annotation_map = {datetime: UtcDateTime, float: Float(53)}  # noqa: RUF012


class Submission(Base):
    """One immutable answer to one question, and the state of its grading."""

    __tablename__ = "submissions"
    __table_args__ = (
        # All that counting the attempts at a question reads, and the way to all submissions of a learner.
        Index(
            "ix_submissions_attempts", "course", "learner", "quiz", "question", "id", "outcome", "uses_attempt"
        ),
        Index("ix_submissions_quiz", "course", "quiz", "id", "question"),
        Index("ix_submissions_question", "course", "question", "id"),
        Index("ix_submissions_course", "course", "id"),
        # SQLite uses it where a query has the condition word for word: `submissions.UNSETTLED`.
        Index("ix_submissions_unsettled", "course", "status", "id", sqlite_where=text("status <> 'graded'"),
              postgresql_where=text("status <> 'graded'")),
    )  # fmt: skip

    id: Mapped[str] = mapped_column(String(32), primary_key=True, default=make_id)
    course: Mapped[str] = mapped_column(String(NAME))
    learner: Mapped[str] = mapped_column(String(32))
    """The id of the member whose answer it is."""
    user: Mapped[str] = mapped_column(String(NAME))
    """The learner's name: a label, which another learner may bear too."""
    quiz: Mapped[str] = mapped_column(String(64))
    question: Mapped[str] = mapped_column(String(64))
    answer: Mapped[str] = mapped_column(Text)
    """Canonical JSON text in ASCII, which any database can store; empty once the learner is erased."""
    seed: Mapped[int | None] = mapped_column(BigInteger)
    """Draws the hidden cases; None without a script. Shown to instructors only."""
    content_digest: Mapped[str] = mapped_column(String(80))
    """Of the quiz when the answer came in."""
    status: Mapped[str] = mapped_column(String(20))
    """queued, running, graded or needs_review."""
    attempt: Mapped[int]
    """From 1. After an answer that used no attempt, the next one gets the same number."""
    uses_attempt: Mapped[bool]
    outcome: Mapped[str | None] = mapped_column(String(20))
    """The status of the newest verdict; None while there is none."""
    revision: Mapped[int] = mapped_column(default=0)
    """Of the newest verdict; 0 while there is none."""
    version: Mapped[int] = mapped_column(Integer)
    """Counts the changes: the ETag."""
    created_at: Mapped[datetime] = mapped_column(default=now)

    __mapper_args__ = {"version_id_col": version}  # noqa: RUF012


class VerdictRow(Base):
    """One verdict on a submission; never removed, and changed by `erasure` alone."""

    __tablename__ = "verdicts"
    __table_args__ = (UniqueConstraint("submission_id", "revision"),)

    id: Mapped[int] = mapped_column(primary_key=True)
    submission_id: Mapped[str] = mapped_column(ForeignKey("submissions.id"))
    revision: Mapped[int]
    cause: Mapped[str] = mapped_column(String(20))
    """grading, regrade, review, rubric where its points have changed, or stop."""
    status: Mapped[str] = mapped_column(String(20))
    points: Mapped[float]
    max_points: Mapped[float]
    course: Mapped[str] = mapped_column(String(NAME))
    seed: Mapped[int | None] = mapped_column(BigInteger)
    content_digest: Mapped[str] = mapped_column(String(80))
    body: Mapped[str] = mapped_column(Text)
    """The whole verdict as JSON text."""
    reviewer: Mapped[str | None] = mapped_column(String(NAME))
    """The reviewer; None if the verdict is the grader's."""
    created_at: Mapped[datetime] = mapped_column(default=now)


class Result(Base):
    """What counts for one learner at one question, and what statistics need of the attempts."""

    __tablename__ = "results"
    __table_args__ = (
        # All that a gradebook sorts by: sums of points do not read the table.
        Index("ix_results_quiz", "course", "quiz", "learner", "question", "changes", "points", "is_final"),
    )

    course: Mapped[str] = mapped_column(String(NAME), primary_key=True)
    learner: Mapped[str] = mapped_column(String(32), primary_key=True)
    quiz: Mapped[str] = mapped_column(String(64), primary_key=True)
    question: Mapped[str] = mapped_column(String(64), primary_key=True)
    submission_id: Mapped[str] = mapped_column(ForeignKey("submissions.id"))
    """The attempt that the points come from; the newest one of an average."""
    attempt: Mapped[int | None]
    """The number of that attempt; None where no attempt counts any more."""
    points: Mapped[float]
    """With late multipliers."""
    max_points: Mapped[float]
    is_late: Mapped[bool]
    """Whether an attempt that counts was handed in after the learner's due date."""
    is_final: Mapped[bool]
    """False while an attempt has no verdict, or the newest one waits for a reviewer."""
    revision: Mapped[int]
    """Counts the changes of the columns above, from 1."""
    first_status: Mapped[str] = mapped_column(String(20))
    first_option: Mapped[int | None]
    first_value: Mapped[float | None]
    """Of the first attempt, as are `first_status`, `first_option` and `first_several`."""
    first_several: Mapped[str | None] = mapped_column(Text)
    """Options or values, where the answer has several: a JSON object with the list `option` or `value`."""
    diagnoses: Mapped[str] = mapped_column(Text)
    """Those of all attempts, each once, as a JSON list."""
    changes: Mapped[int]
    """Counts the changes of any column, from 1."""


class ResultRevision(Base):
    """One change of a result; never changed but for its `position`, never removed. The order of ids is not the order of
    commits. Committed rows get their `position`, so a reader of one has seen all before it."""

    __tablename__ = "result_revisions"
    __table_args__ = (
        Index("ix_result_revisions_feed", "course", "position", unique=True),
        Index(
            "ix_result_revisions_new", "course", "id", sqlite_where=text("position IS NULL"),
            postgresql_where=text("position IS NULL")
        ),
    )  # fmt: skip

    id: Mapped[int] = mapped_column(BigInteger().with_variant(Integer, "sqlite"), primary_key=True)
    position: Mapped[int | None] = mapped_column(BigInteger)
    """From 1 within the course; None until the feed is read."""
    course: Mapped[str] = mapped_column(String(NAME))
    learner: Mapped[str] = mapped_column(String(32))
    quiz: Mapped[str] = mapped_column(String(64))
    question: Mapped[str] = mapped_column(String(64))
    submission_id: Mapped[str] = mapped_column(ForeignKey("submissions.id"))
    attempt: Mapped[int | None]
    points: Mapped[float]
    max_points: Mapped[float]
    is_late: Mapped[bool]
    is_final: Mapped[bool]
    revision: Mapped[int]
    created_at: Mapped[datetime] = mapped_column(default=now)


class ExtensionRow(Base):
    """What one learner gets beyond the policy of a quiz."""

    __tablename__ = "extensions"

    course: Mapped[str] = mapped_column(String(NAME), primary_key=True)
    quiz: Mapped[str] = mapped_column(String(64), primary_key=True)
    learner: Mapped[str] = mapped_column(String(32), primary_key=True)
    due: Mapped[datetime | None]
    until: Mapped[datetime | None]
    attempts: Mapped[int]
    granted_by: Mapped[str] = mapped_column(String(NAME))
    created_at: Mapped[datetime] = mapped_column(default=now)


class Publication(Base):
    """An instructor has published the feedback of a quiz."""

    __tablename__ = "publications"

    course: Mapped[str] = mapped_column(String(NAME), primary_key=True)
    quiz: Mapped[str] = mapped_column(String(64), primary_key=True)
    published_by: Mapped[str] = mapped_column(String(NAME))
    published_at: Mapped[datetime] = mapped_column(default=now)


class Event(Base):
    """A new status of a submission, or the case that its script is at; numbered from 1 within the submission."""

    __tablename__ = "events"

    submission_id: Mapped[str] = mapped_column(ForeignKey("submissions.id"), primary_key=True)
    number: Mapped[int] = mapped_column(primary_key=True, autoincrement=False)
    name: Mapped[str] = mapped_column(String(20))
    created_at: Mapped[datetime] = mapped_column(default=now)


class ReviewClaim(Base):
    """A reviewer's claim on a submission; no other instructor may review it until the claim expires."""

    __tablename__ = "review_claims"

    submission_id: Mapped[str] = mapped_column(ForeignKey("submissions.id"), primary_key=True)
    reviewer: Mapped[str] = mapped_column(String(32))
    """The id of the member."""
    name: Mapped[str] = mapped_column(String(NAME))
    expires_at: Mapped[datetime]


class Review(Base):
    """What is known of a reviewed submission beyond its verdict: who decided, by which rubric, and the second mark."""

    __tablename__ = "reviews"
    __table_args__ = (
        Index("ix_reviews_rubric", "quiz", "question", "rubric"),
        Index("ix_reviews_second", "course", "second", "submission_id"),
    )

    submission_id: Mapped[str] = mapped_column(ForeignKey("submissions.id"), primary_key=True)
    course: Mapped[str] = mapped_column(String(NAME))
    quiz: Mapped[str] = mapped_column(String(64))
    question: Mapped[str] = mapped_column(String(64))
    reviewer: Mapped[str] = mapped_column(String(32))
    """The id of the member whose mark counts."""
    name: Mapped[str] = mapped_column(String(NAME))
    points: Mapped[float]
    rubric: Mapped[str | None] = mapped_column(String(32))
    """The fingerprint of the rubric that the marks were computed with; None if both were given by hand."""
    second: Mapped[str] = mapped_column(String(10))
    """Where the second marking stands: none, waiting, agreed, differs or decided."""
    second_reviewer: Mapped[str | None] = mapped_column(String(32))
    """The id of the second reviewer, as are the columns below of the second mark."""
    second_name: Mapped[str | None] = mapped_column(String(NAME))
    second_points: Mapped[float | None]
    second_ticked: Mapped[str | None] = mapped_column(Text)
    """The ids of the items that give the second mark's points, as a JSON list; None if they were given by hand."""
    second_comment: Mapped[str | None] = mapped_column(Text)


class SavedComment(Base):
    """A comment that reviewers of a question use again."""

    __tablename__ = "saved_comments"
    __table_args__ = (Index("ix_saved_comments_question", "course", "quiz", "question", "id"),)

    id: Mapped[str] = mapped_column(String(32), primary_key=True, default=make_id)
    course: Mapped[str] = mapped_column(String(NAME))
    quiz: Mapped[str] = mapped_column(String(64))
    question: Mapped[str] = mapped_column(String(64))
    text: Mapped[str] = mapped_column(Text)
    saved_by: Mapped[str] = mapped_column(String(NAME))
    """The name of the instructor who wrote it."""
    saved_at: Mapped[datetime] = mapped_column(default=now)


class Member(Base):
    """A person, or a program, in one course. The id identifies it; the name is a label that several may bear."""

    __tablename__ = "members"
    __table_args__ = (
        UniqueConstraint("course", "account", name="uq_members_account"),
        Index("ix_members_name", "course", "name"),
        Index("ix_members_home", "home", sqlite_where=text("home IS NOT NULL"),
              postgresql_where=text("home IS NOT NULL")),
    )  # fmt: skip

    id: Mapped[str] = mapped_column(String(32), primary_key=True, default=make_member_id)
    course: Mapped[str] = mapped_column(String(NAME))
    name: Mapped[str] = mapped_column(String(NAME))
    account: Mapped[str | None] = mapped_column(String(NAME + 10))
    """How the member is found again: `name:NAME`, `oidc:DIGEST` or `lms:DIGEST`. None if only by a browser session."""
    role: Mapped[str] = mapped_column(String(20))
    created_at: Mapped[datetime] = mapped_column(default=now)
    removed_at: Mapped[datetime | None]
    namespace: Mapped[str | None] = mapped_column(String(NAMESPACE))
    """The other system that knows the member as `external_id`; the account is a digest of both."""
    external_id: Mapped[str | None] = mapped_column(String(EXTERNAL_ID))
    email: Mapped[str | None] = mapped_column(String(EMAIL))
    named_by: Mapped[str | None] = mapped_column(String(NAME))
    """The instructor who set the name; None while it follows platforms and rosters."""
    home: Mapped[str | None] = mapped_column(String(32))
    """The member of another course who is the same person, and enters this course from there."""


class Credential(Base):
    """A bearer token, a browser session or a one-time code, by `kind`. Only the hash of its secret is stored."""

    __tablename__ = "credentials"
    __table_args__ = (
        Index("ix_credentials_member", "member"),
        Index(
            "ix_credentials_home",
            "home",
            sqlite_where=text("home IS NOT NULL"),
            postgresql_where=text("home IS NOT NULL"),
        ),
        Index("ix_credentials_expires_at", "kind", "expires_at"),
        Index("ix_credentials_course", "course", "kind"),
    )

    id: Mapped[str] = mapped_column(String(32), primary_key=True)
    kind: Mapped[str] = mapped_column(String(10))
    secret_hash: Mapped[str] = mapped_column(String(64))
    member: Mapped[str] = mapped_column(ForeignKey("members.id"))
    user: Mapped[str] = mapped_column(String(NAME))
    role: Mapped[str] = mapped_column(String(20))
    course: Mapped[str] = mapped_column(String(NAME))
    scopes: Mapped[str | None] = mapped_column(Text)
    """Names of scopes, separated by blanks; None for all that the role may."""
    created_by: Mapped[str | None] = mapped_column(String(NAME))
    """The name of the member who issued it, if one did."""
    label: Mapped[str | None] = mapped_column(String(NAME))
    """What a device calls itself that its owner gave a token."""
    platform: Mapped[int | None]
    """The learning platform whose launch opened a browser session."""
    home: Mapped[str | None] = mapped_column(String(32))
    """The session from which its owner entered another course of theirs: it leads back, and both end together."""
    created_at: Mapped[datetime] = mapped_column(default=now)
    expires_at: Mapped[datetime | None]
    revoked_at: Mapped[datetime | None]
    last_used_at: Mapped[datetime | None]


class IdempotencyKey(Base):
    """The submission that a learner's request with this key made."""

    __tablename__ = "idempotency_keys"
    __table_args__ = (Index("ix_idempotency_keys_created_at", "created_at"),)

    course: Mapped[str] = mapped_column(String(NAME), primary_key=True)
    learner: Mapped[str] = mapped_column(String(32), primary_key=True)
    key: Mapped[str] = mapped_column(String(255), primary_key=True)
    request_digest: Mapped[str] = mapped_column(String(64))
    submission_id: Mapped[str] = mapped_column(ForeignKey("submissions.id"))
    http_status: Mapped[int]
    created_at: Mapped[datetime] = mapped_column(default=now)


class InstallationSecret(Base):
    """A key of the installation. Its value never leaves the server."""

    __tablename__ = "installation_secrets"

    name: Mapped[str] = mapped_column(String(40), primary_key=True)
    value: Mapped[bytes]


class InstallationFact(Base):
    """What commands have to know of the server that works on this database."""

    __tablename__ = "installation_facts"

    name: Mapped[str] = mapped_column(String(40), primary_key=True)
    value: Mapped[str] = mapped_column(Text)
