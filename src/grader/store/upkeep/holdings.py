"""Everything that the tables hold of one member, without secrets: what `erasure` takes out, and what it leaves."""

import json
from collections.abc import Sequence
from typing import Any

from sqlalchemy import ColumnElement, or_, select
from sqlalchemy.orm import Session

from grader.store.courses import AuditEntry
from grader.store.outbox import Delivery
from grader.store.platforms import Context, LtiUser, PlatformRow
from grader.store.regrades import RegradeItem
from grader.store.reviewing.line_comments import BY_LINE, LineComment, TriedCopy
from grader.store.tables import (
    ERASED,
    Base,
    Credential,
    Event,
    ExtensionRow,
    IdempotencyKey,
    Member,
    Result,
    ResultRevision,
    Review,
    ReviewClaim,
    Submission,
    VerdictRow,
)
from grader.store.upkeep.erasure import names_in_audit

SECRETS = {"secret_hash", "seed"}
"""Columns that are left out: the hash of a credential, and what draws the hidden cases."""

JSON_TEXT = {"answer", "body", "detail", "diagnoses", "second_ticked", "sent", "tried"}
"""Columns whose text is JSON."""

OF_SUBMISSION: dict[str, type[Base]] = {
    "verdicts": VerdictRow,
    "events": Event,
    "reviews": Review,
    "claims": ReviewClaim,
    "line_comments": LineComment,
    "tried_copies": TriedCopy,
}
OF_LEARNER: dict[str, type[Base]] = {
    "results": Result,
    "result_revisions": ResultRevision,
    "extensions": ExtensionRow,
    "idempotency_keys": IdempotencyKey,
    "regrade_items": RegradeItem,
    "deliveries": Delivery,
}


def gather_holdings(session: Session, member: Member) -> dict[str, Any]:
    """The member, their credentials, submissions and results, and the audit log's entries about them, as plain values.
    Each submission has its verdicts, events, review and claim."""
    theirs = Submission.course == member.course, Submission.learner == member.id
    ids = select(Submission.id).where(*theirs)
    below = {
        name: read_rows(session, row, _column(row, "submission_id").in_(ids)) for name, row in OF_SUBMISSION.items()
    }
    submissions = read_rows(session, Submission, *theirs)
    for submission in submissions:
        submission |= {
            name: [row for row in rows if row["submission_id"] == submission["id"]] for name, rows in below.items()
        }
    is_about = or_(
        names_in_audit(session, member),
        AuditEntry.actor == member.id,
        AuditEntry.detail.contains(member.id),
        AuditEntry.subject == member.id,
        AuditEntry.subject.in_(ids),
    )
    return {
        "member": read_values(member),
        "credentials": read_rows(session, Credential, Credential.member == member.id),
        "platforms": gather_platforms(session, member),
        "submissions": submissions,
        **{name: read_rows(session, row, _column(row, "learner") == member.id) for name, row in OF_LEARNER.items()},
        "audit": read_rows(session, AuditEntry, AuditEntry.course == member.course, is_about),
    }


def gather_platforms(session: Session, member: Member) -> list[dict[str, Any]]:
    """What learning platforms have told of the member, and in which of their courses."""
    rows = (
        select(LtiUser, Context.title, PlatformRow.issuer)
        .join(Context, Context.id == LtiUser.context)
        .join(PlatformRow, PlatformRow.id == Context.platform)
        .where(LtiUser.member == member.id)
    )
    return [{**read_values(user), "title": title, "issuer": issuer} for user, title, issuer in session.execute(rows)]


def read_rows(session: Session, table: type[Base], *where: ColumnElement[bool]) -> list[dict[str, Any]]:
    """The rows of a table, in the order of its key; comments on a script line by line."""
    order: Sequence[Any] = BY_LINE if table is LineComment else table.__mapper__.primary_key
    return [read_values(row) for row in session.scalars(select(table).where(*where).order_by(*order))]


def read_values(row: Base) -> dict[str, Any]:
    """A row by column, with JSON as what it says; without secrets. A number of an old answer that JSON has not, such as
    NaN, becomes its text."""
    values = {
        column.key: getattr(row, column.key) for column in row.__mapper__.column_attrs if column.key not in SECRETS
    }
    texts = {name: values[name] for name in JSON_TEXT if values.get(name) not in (None, ERASED)}
    parsed = {name: json.loads(text, parse_constant=str) for name, text in texts.items()}
    return values | parsed


def _column(table: type[Base], name: str) -> Any:
    return getattr(table, name)
