"""The audit log: who did what in a course."""

import json
from enum import StrEnum
from typing import Any

from sqlalchemy.orm import Session

from grader.courses.people.identity import Identity
from grader.store.courses import AuditEntry

COMMAND_LINE = "command line"


class Action(StrEnum):
    """What is recorded."""

    INVITED = "invited"
    JOINED = "joined"
    SIGNED_IN = "signed in"
    INVITATION_REVOKED = "invitation revoked"
    TOKEN_CREATED = "token created"  # noqa: S105
    TOKEN_REVOKED = "token revoked"  # noqa: S105
    DEVICE_ALLOWED = "device allowed"
    CREDENTIALS_REVOKED = "credentials revoked"
    MEMBER_REMOVED = "member removed"
    MEMBER_ERASED = "member erased"
    MEMBER_EXPORTED = "member exported"
    RENAMED = "member renamed"
    ROLE_CHANGED = "role changed"
    ROSTER_IMPORTED = "roster imported"
    COURSE_MADE = "course made"
    LINK_ROTATED = "course link rotated"
    LINK_CLOSED = "course link closed"
    REVIEWED = "reviewed"
    CLAIMED = "review claimed"
    RELEASED = "review released"
    REVIEW_WITHDRAWN = "review taken back"
    MARKED_SECOND = "marked a second time"
    RECOMPUTED = "review recomputed"
    COMMENT_SAVED = "comment saved"
    COMMENT_CHANGED = "comment changed"
    COMMENT_DELETED = "comment deleted"
    LINE_COMMENTED = "script commented"
    LINE_COMMENT_DELETED = "comment on a script deleted"
    EXTENDED = "extension changed"
    POLICY_CHANGED = "dates and rules changed"
    PUBLISHED = "feedback published"
    WITHDRAWN = "feedback withheld"
    REGRADED = "regrade started"
    REGRADE_CANCELLED = "regrade cancelled"
    WEBHOOK_CREATED = "webhook created"
    WEBHOOK_ROTATED = "webhook secret rotated"
    WEBHOOK_ENABLED = "webhook enabled"
    WEBHOOK_DELETED = "webhook deleted"
    REPLAYED = "delivery replayed"
    CONTENT_RELOADED = "content reloaded"
    PLATFORM_ADDED = "platform added"
    PLATFORM_APPROVED = "platform approved"
    PLATFORM_REMOVED = "platform removed"
    SIGNING_KEY_ROTATED = "signing key rotated"
    HIDDEN_CASES_ROTATED = "key of the hidden cases rotated"
    CONTEXT_WANTED = "platform course asks for a link"
    CONTEXT_LINKED = "platform course linked"
    CONTEXT_UNLINKED = "platform course unlinked"
    ROSTER_PULLED = "roster pulled"
    LOOKED_UP = "answers under review looked up by name"
    SEEN_AS = "course seen as a learner"


def record(
    session: Session, who: Identity | None, course: str, action: Action, subject: str = "", *,
    unsigned: str = COMMAND_LINE, **detail: Any,
) -> None:  # fmt: skip
    """Adds an entry in the transaction of what it records. Where `who` is None, it is signed `unsigned`."""
    name = unsigned if who is None else who.user
    text = json.dumps(detail)
    actor = None if who is None else who.id
    session.add(AuditEntry(course=course, actor=actor, name=name, action=action.value, subject=subject, detail=text))
