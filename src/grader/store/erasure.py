"""Takes a learner's personal data out of every table; what is left says that somebody had these points.

The id of the learner stays: it is random, and joins the rows that statistics need. Times and points stay as well.
"""

import json

from sqlalchemy import ColumnElement, delete, func, insert, select, text, update
from sqlalchemy.orm import Session

from grader.domain.verdict import Verdict
from grader.store import outbox, platforms
from grader.store.courses import AuditEntry
from grader.store.results import COUNTED, LearnerAt
from grader.store.reviews import DECIDED, DIFFERS, NONE, WAITING
from grader.store.submissions import AT_REST, GRADED, NEEDS_REVIEW
from grader.store.tables import (
    ERASED,
    Credential,
    IdempotencyKey,
    Member,
    Result,
    ResultRevision,
    Review,
    ReviewClaim,
    Submission,
    VerdictRow,
    now,
)

PREFIX = "erased-"
"""How the names of erased learners begin; the triggers of the audit log know it too."""

STATISTICS = ("option", "value")
"""What results take from the evidence of a verdict."""

VERDICTS_AT_ONCE = 500

UNCHANGED = {"synchronize_session": False}


def ungraded(session: Session, member: Member) -> int:
    """The number of the member's submissions that wait for the grader."""
    waiting = select(func.count()).where(*_theirs(member), Submission.status.not_in(AT_REST))
    return session.scalar(waiting) or 0


def erase(session: Session, member: Member) -> str:
    """Erases the member, whose submissions are all graded. Returns the name that stands in place of theirs."""
    pseudonym = f"{PREFIX}{member.id[:8]}"
    if session.get_bind().dialect.name == "sqlite":
        session.execute(text("PRAGMA secure_delete = ON"))  # overwrites what is deleted, in the file too
    _audit(session, member, pseudonym)
    _verdicts(session, member)
    _submissions(session, member, pseudonym)
    _results(session, member)
    platforms.forget_member(session, member.id)
    outbox.erase(session, member.course, member.id)
    for row, theirs in ((Credential, Credential.member), (IdempotencyKey, IdempotencyKey.learner)):
        session.execute(delete(row).where(theirs == member.id), execution_options=UNCHANGED)
    member.name, member.account, member.removed_at = pseudonym, None, now()
    member.namespace = member.external_id = member.email = None
    return pseudonym


def _submissions(session: Session, member: Member, pseudonym: str) -> None:
    """Empties the answers. What waited for a reviewer waits no more."""
    ids = select(Submission.id).where(*_theirs(member))
    session.execute(delete(ReviewClaim).where(ReviewClaim.submission_id.in_(ids)), execution_options=UNCHANGED)
    reviews = update(Review).where(Review.submission_id.in_(ids))
    session.execute(reviews.values(second_comment=None), execution_options=UNCHANGED)
    for unsettled, settled in ((WAITING, NONE), (DIFFERS, DECIDED)):
        session.execute(reviews.where(Review.second == unsettled).values(second=settled), execution_options=UNCHANGED)
    empty = update(Submission).where(*_theirs(member))
    values = {"user": pseudonym, "answer": ERASED, "seed": None, "version": Submission.version + 1}
    session.execute(empty.values(values), execution_options=UNCHANGED)
    waits = empty.where(Submission.status == NEEDS_REVIEW)
    session.execute(waits.values(status=GRADED), execution_options=UNCHANGED)


def _verdicts(session: Session, member: Member) -> None:
    """Leaves of each verdict what results are counted from: points, status, diagnosis, and the number or option."""
    theirs = select(VerdictRow.id).join(Submission, Submission.id == VerdictRow.submission_id).where(*_theirs(member))
    ids = session.scalars(theirs).all()
    for start in range(0, len(ids), VERDICTS_AT_ONCE):
        some = select(VerdictRow).where(VerdictRow.id.in_(ids[start : start + VERDICTS_AT_ONCE]))
        for row in session.scalars(some):
            row.body, row.seed = reduced(Verdict.model_validate_json(row.body)).model_dump_json(), None


def reduced(verdict: Verdict) -> Verdict:
    """The verdict without what a learner, a script or a reviewer wrote."""
    evidence = {name: verdict.evidence[name] for name in STATISTICS if name in verdict.evidence}
    kept = verdict.model_dump(include={"status", "points", "max_points", "diagnosis", "environment", "content_digest"})
    return Verdict(**kept, evidence=evidence)


def _results(session: Session, member: Member) -> None:
    """Adds a row to the feed for each result, so that its readers hear of the new name."""
    theirs = (Result.course == member.course, Result.learner == member.id)
    again = update(Result).where(*theirs).values(revision=Result.revision + 1, changes=Result.changes + 1)
    session.execute(again, execution_options=UNCHANGED)
    told = [getattr(Result, name) for name in (*LearnerAt._fields, *COUNTED, "revision")]
    new = select(*told).where(*theirs).order_by(Result.quiz, Result.question)
    session.execute(insert(ResultRevision).from_select([column.key for column in told], new))


def _audit(session: Session, member: Member, pseudonym: str) -> None:
    """Replaces the name in the audit log, whose triggers allow this and no other change."""
    here, detail = AuditEntry.course == member.course, AuditEntry.detail
    theirs = detail.contains(member.id)
    if member.account is not None:  # no other member has this account: entries without an id mean this one
        theirs |= ~detail.contains('"member": ') & (AuditEntry.name != AuditEntry.subject)
    is_actor, is_subject = AuditEntry.actor == member.id, AuditEntry.subject == member.name
    is_named = detail.contains(json.dumps(member.name), autoescape=True)
    for where, values in (
        (is_subject & (is_actor | theirs), {"subject": pseudonym}),
        (is_actor, {"name": pseudonym}),
        (is_named & theirs, {"detail": "{}"}),
    ):
        session.execute(update(AuditEntry).where(here, where).values(values), execution_options=UNCHANGED)


def _theirs(member: Member) -> tuple[ColumnElement[bool], ...]:
    return Submission.course == member.course, Submission.learner == member.id
