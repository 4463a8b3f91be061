"""Regrades and what each of their submissions came to: the tables, and every query on them."""

import json
from collections.abc import Iterable, Sequence
from datetime import datetime
from typing import Any

from sqlalchemy import ForeignKey, Index, String, Text, exists, func, insert, select, update
from sqlalchemy.orm import Mapped, Session, aliased, mapped_column

from grader.store.engine.ids import make_id
from grader.store.submissions import NEWEST, REVIEW, STOP, WITHDRAWN
from grader.store.tables import ERASED, NAME, Base, Submission, VerdictRow, now

QUEUED, RUNNING, DONE, CANCELLED, FAILED = "queued", "running", "done", "cancelled", "failed"
UNFINISHED = (QUEUED, RUNNING)

WAITING = "waiting"
"""The outcome of an item that is not regraded yet."""

LANES = 8
"""Jobs of one regrade that may be in progress at the same time; a learner's submissions are in the same lane."""

ROWS = 1000
"""Values in one IN (...)."""


class Regrade(Base):
    """Grading submissions of a quiz again, by one content. A dry run changes nothing but these tables."""

    __tablename__ = "regrades"
    __table_args__ = (Index("ix_regrades_course", "course", "id"),)

    id: Mapped[str] = mapped_column(String(32), primary_key=True, default=make_id)
    course: Mapped[str] = mapped_column(String(NAME))
    quiz: Mapped[str] = mapped_column(String(64))
    question: Mapped[str | None] = mapped_column(String(64))
    """None for all questions."""
    scope: Mapped[str] = mapped_column(Text)
    """JSON, as requested."""
    dry_run: Mapped[bool]
    content_digest: Mapped[str] = mapped_column(String(80))
    """Of the content to grade by."""
    status: Mapped[str] = mapped_column(String(20))
    reason: Mapped[str | None] = mapped_column(Text)
    """Why it failed."""
    counts: Mapped[str | None] = mapped_column(Text)
    """The items by outcome when it ended, as JSON: a list of regrades need not count them."""
    created_by: Mapped[str] = mapped_column(String(NAME))
    created_at: Mapped[datetime] = mapped_column(default=now)
    finished_at: Mapped[datetime | None]


class RegradeItem(Base):
    """One submission of a regrade. It names the submission by id, without a foreign key."""

    __tablename__ = "regrade_items"
    __table_args__ = (
        Index("ix_regrade_items_outcome", "regrade_id", "outcome", "number"),
        Index("ix_regrade_items_place", "regrade_id", "place"),
    )

    regrade_id: Mapped[str] = mapped_column(ForeignKey("regrades.id"), primary_key=True)
    number: Mapped[int] = mapped_column(primary_key=True, autoincrement=False)
    """From 1, in the order of places, and of handing in."""
    place: Mapped[int]
    """From 1, one for each learner and question."""
    submission_id: Mapped[str] = mapped_column(String(32))
    learner: Mapped[str] = mapped_column(String(32))
    question: Mapped[str] = mapped_column(String(64))
    outcome: Mapped[str] = mapped_column(String(20))
    """`waiting`, or one of `courses.regrading.Outcome`."""
    tries: Mapped[int]
    """How often the grader itself has failed."""
    old_status: Mapped[str | None] = mapped_column(String(20))
    old_points: Mapped[float | None]
    new_status: Mapped[str | None] = mapped_column(String(20))
    new_points: Mapped[float | None]
    counted_before: Mapped[float | None]
    """What counted for the learner at the question before this submission was regraded; None if nothing did."""
    counted_after: Mapped[float | None]


def list_candidates(
    session: Session, course: str, quiz: str, questions: Sequence[str], ids: Sequence[str] | None
) -> Iterable[Any]:
    """The submissions with the points of their newest verdicts, by learner and question, oldest first."""
    columns = (Submission.id, Submission.learner, Submission.question, Submission.attempt, Submission.created_at)
    rows = select(*columns, Submission.uses_attempt, Submission.outcome, VerdictRow.points)
    rows = rows.outerjoin(VerdictRow, NEWEST)
    rows = rows.where(Submission.course == course, Submission.quiz == quiz, Submission.question.in_(questions))
    rows = rows.where(Submission.answer != ERASED)
    if ids is not None:
        rows = rows.where(Submission.id.in_(ids))
    return session.execute(rows.order_by(Submission.learner, Submission.question, Submission.id))


def add(session: Session, regrade: Regrade, items: list[dict[str, Any]]) -> None:
    """Inserts a regrade; `items` are columns of its rows."""
    session.add(regrade)
    session.flush()
    if items:
        fixed = {"regrade_id": regrade.id, "outcome": WAITING, "tries": 0}
        session.connection().execute(insert(RegradeItem), [item | fixed for item in items])


def find(session: Session, regrade_id: str, course: str) -> Regrade | None:
    """The regrade, if the course has it."""
    regrade = session.get(Regrade, regrade_id)
    return regrade if regrade is not None and regrade.course == course else None


def lock(session: Session, regrade_id: str) -> Regrade:
    """The regrade as it is now; nothing else changes it until the transaction ends."""
    return session.get_one(Regrade, regrade_id, with_for_update=True, populate_existing=True)


def page(session: Session, course: str, before: str | None, limit: int) -> Sequence[Regrade]:
    """At most `limit` regrades of a course, newest first, that are older than `before`."""
    newest_first = select(Regrade).where(Regrade.course == course).order_by(Regrade.id.desc()).limit(limit)
    return session.scalars(newest_first if before is None else newest_first.where(Regrade.id < before)).all()


def list_unfinished(session: Session, course: str) -> Sequence[Regrade]:
    """The regrades of a course that are queued or running."""
    return session.scalars(select(Regrade).where(Regrade.course == course, Regrade.status.in_(UNFINISHED))).all()


def begin(session: Session, regrade_id: str) -> None:
    """Marks a queued regrade as running; one that was cancelled meanwhile stays so."""
    queued = update(Regrade).where(Regrade.id == regrade_id, Regrade.status == QUEUED).values(status=RUNNING)
    session.execute(queued, execution_options={"synchronize_session": False})


def finish(session: Session, regrade: Regrade, status: str, reason: str | None = None) -> None:
    """Ends a regrade; its jobs find nothing more to do."""
    regrade.counts = json.dumps(count_by_outcome(session, regrade))
    regrade.status, regrade.reason, regrade.finished_at = status, reason, now()


def list_waiting(session: Session, regrade_id: str, lane: int | None, limit: int) -> Sequence[RegradeItem]:
    """The first items of a lane, or of all, that are not regraded yet."""
    items = select(RegradeItem).where(RegradeItem.regrade_id == regrade_id, RegradeItem.outcome == WAITING)
    if lane is not None:
        items = items.where(RegradeItem.place % LANES == lane)
    return session.scalars(items.order_by(RegradeItem.number).limit(limit)).all()


def get_numbered(session: Session, regrade_id: str, numbers: Sequence[int]) -> Sequence[RegradeItem]:
    """The items with these numbers, as they are now."""
    items = select(RegradeItem).where(RegradeItem.regrade_id == regrade_id, RegradeItem.number.in_(numbers))
    return session.scalars(items.execution_options(populate_existing=True)).all()


def at_place(session: Session, regrade_id: str, place: int) -> Sequence[RegradeItem]:
    """The items of one learner at one question."""
    return session.scalars(
        select(RegradeItem).where(RegradeItem.regrade_id == regrade_id, RegradeItem.place == place)
    ).all()


def find_reviewed(session: Session, ids: Sequence[str]) -> set[str]:
    """Which of these submissions a person has decided: a reviewer, who has not taken the mark back, or the learner who
    stopped the script."""
    later = aliased(VerdictRow)
    taken_back = exists().where(
        later.submission_id == VerdictRow.submission_id, later.revision > VerdictRow.revision, later.cause == WITHDRAWN
    )
    decided = (VerdictRow.cause == STOP) | ((VerdictRow.cause == REVIEW) & ~taken_back)
    rows = select(VerdictRow.submission_id).where(VerdictRow.submission_id.in_(ids), decided)
    return set(session.scalars(rows))


def count_by_outcome(session: Session, regrade: Regrade) -> dict[str, int]:
    """The number of items by outcome."""
    if regrade.counts is not None:
        return dict(json.loads(regrade.counts))
    counts = select(RegradeItem.outcome, func.count()).where(RegradeItem.regrade_id == regrade.id)
    return {row[0]: row[1] for row in session.execute(counts.group_by(RegradeItem.outcome))}


def list_learners(
    session: Session, regrade_id: str, after: int, limit: int, outcome: str | None = None
) -> list[tuple[RegradeItem, str | None]]:
    """The items of at most `limit` places after one, each with the learner's name; or of those with this outcome."""
    places = select(RegradeItem.place).where(RegradeItem.regrade_id == regrade_id, RegradeItem.place > after)
    if outcome is not None:
        places = places.where(RegradeItem.outcome == outcome)
    wanted = list(session.scalars(places.distinct().order_by(RegradeItem.place).limit(limit)))
    rows = select(RegradeItem, Submission.user).outerjoin(Submission, Submission.id == RegradeItem.submission_id)
    here = rows.where(RegradeItem.regrade_id == regrade_id, RegradeItem.place.in_(wanted))
    return [(item, user) for item, user in session.execute(here.order_by(RegradeItem.number))]
