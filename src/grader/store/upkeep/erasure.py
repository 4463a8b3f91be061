"""Takes a learner's personal data out of every table; what is left says that somebody had these points. The id of the
learner stays: it is random, and joins the rows that statistics need. Times and points stay as well."""

import json
from collections.abc import Sequence

from sqlalchemy import ColumnElement, Select, delete, exists, func, insert, or_, select, text, update
from sqlalchemy.orm import Session

from grader.domain.verdict import Verdict
from grader.store import outbox, platforms
from grader.store.courses import AuditEntry
from grader.store.results import COUNTED, LearnerAt
from grader.store.reviewing.line_comments import LineComment, TriedCopy
from grader.store.reviewing.reviews import DECIDED, DIFFERS, NONE, WAITING
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
"""What results take from the evidence of a verdict on a choice or a number; that on a script or a text has neither."""

BY_ID = (
    "invited",
    "invitation revoked",
    "joined",
    "member removed",
    "member exported",
    "member renamed",
    "role changed",
)
BY_ACTOR = ("joined", "signed in")
BY_NAME = ("token created", "token revoked", "credentials revoked", "answers under review looked up by name")
"""Actions of the audit log whose subject is a member's name: whose it is tells the id in the detail, the actor, or the
name alone. The subject of all others is no name, though somebody may bear one that looks like it."""

WITH_NAME = "extension changed"
"""The action whose detail has a name."""

VERDICTS_AT_ONCE = 500

UNCHANGED = {"synchronize_session": False}


def count_ungraded(session: Session, member: Member) -> int:
    """The number of the member's submissions that wait for the grader."""
    waiting = select(func.count()).where(*_theirs(member), Submission.status.not_in(AT_REST))
    return session.scalar(waiting) or 0


def erase(session: Session, member: Member) -> str:
    """Erases the member, whose submissions are all graded. Returns the name that replaces theirs."""
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
    commented = delete(LineComment).where(LineComment.submission_id.in_(ids))
    session.execute(commented, execution_options=UNCHANGED)
    _copies(session, ids)
    empty = update(Submission).where(*_theirs(member))
    values = {"user": pseudonym, "answer": ERASED, "seed": None, "version": Submission.version + 1}
    session.execute(empty.values(values), execution_options=UNCHANGED)
    waits = empty.where(Submission.status == NEEDS_REVIEW)
    session.execute(waits.values(status=GRADED), execution_options=UNCHANGED)


def _copies(session: Session, originals: Select[str]) -> None:
    """Empties the changed copies of these submissions that instructors ran."""
    copies = select(TriedCopy.submission_id).where(TriedCopy.original.in_(originals))
    _reduce(session, session.scalars(select(VerdictRow.id).where(VerdictRow.submission_id.in_(copies))).all())
    empty = update(Submission).where(Submission.id.in_(copies))
    values = {"answer": ERASED, "seed": None, "version": Submission.version + 1}
    session.execute(empty.values(values), execution_options=UNCHANGED)


def _verdicts(session: Session, member: Member) -> None:
    """Leaves of each verdict what results are counted from, in the list of mistakes of each result too."""
    theirs = select(VerdictRow.id).join(Submission, Submission.id == VerdictRow.submission_id).where(*_theirs(member))
    _reduce(session, session.scalars(theirs).all())
    _mistakes(session, member)


def _reduce(session: Session, ids: Sequence[int]) -> None:
    """Reduces the verdicts with these ids."""
    for start in range(0, len(ids), VERDICTS_AT_ONCE):
        some = select(VerdictRow).where(VerdictRow.id.in_(ids[start : start + VERDICTS_AT_ONCE]))
        for row in session.scalars(some):
            row.body, row.seed = reduce_verdict(Verdict.model_validate_json(row.body), row.seed).model_dump_json(), None
    session.flush()


def _mistakes(session: Session, member: Member) -> None:
    """Leaves of the mistakes that results list those that the reduced verdicts still tell."""
    diagnoses: dict[tuple[str, str], set[str | None]] = {}
    rows = select(Submission.quiz, Submission.question, VerdictRow.body)
    rows = rows.join(VerdictRow, VerdictRow.submission_id == Submission.id).where(*_theirs(member))
    for quiz, question, body in session.execute(rows):
        diagnoses.setdefault((quiz, question), set()).add(json.loads(body)["diagnosis"])
    for result in session.scalars(select(Result).where(Result.course == member.course, Result.learner == member.id)):
        known = diagnoses.get((result.quiz, result.question), set())
        result.diagnoses = json.dumps([diagnosis for diagnosis in json.loads(result.diagnoses) if diagnosis in known])


def reduce_verdict(verdict: Verdict, seed: int | None) -> Verdict:
    """The verdict without what a learner, a script or a reviewer wrote: points, status, and the number or option. The
    sentence of the mistake stays for a number or an option, since the grader has it ready for them. That for a script,
    which is the answer with a `seed`, may quote what the script raised, returned or named."""
    evidence = {name: verdict.evidence[name] for name in STATISTICS if name in verdict.evidence and seed is None}
    fields = {"status", "points", "max_points", "environment", "content_digest"} | (
        {"diagnosis"} if evidence else set()
    )
    return Verdict(**verdict.model_dump(include=fields), evidence=evidence)


def _results(session: Session, member: Member) -> None:
    """Adds a row to the feed for each result, so that its readers hear of the new name."""
    theirs = (Result.course == member.course, Result.learner == member.id)
    again = update(Result).where(*theirs).values(revision=Result.revision + 1, changes=Result.changes + 1)
    session.execute(again, execution_options=UNCHANGED)
    columns = [getattr(Result, name) for name in (*LearnerAt._fields, *COUNTED, "revision")]
    new = select(*columns).where(*theirs).order_by(Result.quiz, Result.question)
    session.execute(insert(ResultRevision).from_select([column.key for column in columns], new))


def _audit(session: Session, member: Member, pseudonym: str) -> None:
    """Replaces the names in the audit log, also earlier ones; its triggers allow this and no other change."""
    has_id, is_actor = AuditEntry.detail.contains(member.id), AuditEntry.actor == member.id
    for where, values in (
        (names_in_audit(session, member), {"subject": pseudonym}),
        (is_actor, {"name": pseudonym}),
        (has_id & (AuditEntry.action == WITH_NAME), {"detail": "{}"}),
    ):
        change = update(AuditEntry).where(AuditEntry.course == member.course, where).values(values)
        session.execute(change, execution_options=UNCHANGED)


def names_in_audit(session: Session, member: Member) -> ColumnElement[bool]:
    """Whether the subject of an entry of the audit log is a name of the member, or was one."""
    names = {(member.account or "").removeprefix("name:")} if (member.account or "").startswith("name:") else set()
    if not _has_namesake(session, member):
        names.add(member.name)
    return or_(
        AuditEntry.detail.contains(member.id) & AuditEntry.action.in_(BY_ID),
        (AuditEntry.actor == member.id) & AuditEntry.action.in_(BY_ACTOR),
        AuditEntry.action.in_(BY_NAME) & AuditEntry.subject.in_(names),
    )


def _has_namesake(session: Session, member: Member) -> bool:
    """Whether somebody else in the course bears the name; removed ones count."""
    another = (Member.course == member.course, Member.name == member.name, Member.id != member.id)
    return session.scalar(select(exists().where(*another))) or False


def _theirs(member: Member) -> tuple[ColumnElement[bool], ...]:
    return Submission.course == member.course, Submission.learner == member.id
