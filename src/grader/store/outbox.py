"""The outbox: what has to be delivered, in one row for each destination and learner, and every query on it. A row says
that something changed, and no more: its sender reads the result when it sends, so that the newest one wins. `version`
counts the changes. Every row that waits has one job of the queue, and `has_job` says so; both change under the row's
lock."""

import hashlib
from collections.abc import Collection, Iterator, Sequence
from datetime import datetime
from functools import cache
from typing import Any, NamedTuple

from sqlalchemy import (
    BigInteger,
    ColumnElement,
    ForeignKey,
    Index,
    Integer,
    String,
    Text,
    UniqueConstraint,
    and_,
    bindparam,
    case,
    delete,
    func,
    select,
    text,
    update,
)
from sqlalchemy.orm import Mapped, Session, mapped_column

from grader.store.engine.bulk import get_insert
from grader.store.engine.ids import make_id
from grader.store.results import LearnerAt
from grader.store.tables import NAME, Base, Result, now

WEBHOOK, SCORES = KINDS = ("webhook", "scores")
"""The kinds of destinations."""

WAITING, HELD, SENT, DEAD = STATES = ("waiting", "held", "sent", "dead")
"""Of a row. `held` waits until its learner may see the feedback."""

AT_ONCE = 500
"""Rows read at a time."""

ALL = ""
"""Any quiz or question of a destination; as the question of a row, the whole quiz."""


class Destination(Base):
    """Where results of a course go: to a webhook, or as scores to the learning platforms of its learners."""

    __tablename__ = "destinations"
    __table_args__ = (Index("ix_destinations_course", "course", "id"),)

    id: Mapped[str] = mapped_column(String(32), primary_key=True, default=make_id)
    course: Mapped[str] = mapped_column(String(NAME))
    kind: Mapped[str] = mapped_column(String(10))
    quiz: Mapped[str] = mapped_column(String(64), default=ALL)
    """Only results of this quiz; `ALL` for every quiz."""
    question: Mapped[str] = mapped_column(String(64), default=ALL)
    """Only results of this question. The scores of a destination with `ALL` are those of the whole quiz."""
    url: Mapped[str | None] = mapped_column(Text)
    """Of a webhook, as are the columns of secrets; or the address of the column of a gradebook that a link leads to, as
    the newest launch told it. None for scores of a quiz or question that belong to no link: earlier versions left such
    destinations, and they are of every learner."""
    secret: Mapped[str | None] = mapped_column(String(80))
    old_secret: Mapped[str | None] = mapped_column(String(80))
    old_until: Mapped[datetime | None]
    """Until then deliveries are signed with the old secret too."""
    created_by: Mapped[str] = mapped_column(String(NAME))
    created_at: Mapped[datetime] = mapped_column(default=now)
    disabled_at: Mapped[datetime | None]
    why_disabled: Mapped[str | None] = mapped_column(Text)


class Delivery(Base):
    """The newest change of a learner's result for one destination, and how far its delivery is."""

    __tablename__ = "outbox"
    __table_args__ = (
        UniqueConstraint("destination", "learner", "quiz", "question", name="uq_outbox"),
        Index("ix_outbox_course", "course", "state", "id"),
        Index("ix_outbox_learner", "course", "learner"),
        Index(
            "ix_outbox_open", "state", sqlite_where=text("state <> 'sent'"), postgresql_where=text("state <> 'sent'")
        ),
    )

    id: Mapped[int] = mapped_column(BigInteger().with_variant(Integer, "sqlite"), primary_key=True)
    destination: Mapped[str] = mapped_column(ForeignKey("destinations.id"))
    course: Mapped[str] = mapped_column(String(NAME))
    learner: Mapped[str] = mapped_column(String(32))
    quiz: Mapped[str] = mapped_column(String(64))
    question: Mapped[str] = mapped_column(String(64))
    state: Mapped[str] = mapped_column(String(10))
    version: Mapped[int]
    """Counts the changes of the result, from 1."""
    noted_at: Mapped[datetime]
    """When the newest change was noted."""
    has_job: Mapped[bool]
    attempts: Mapped[int]
    """Failed tries to deliver this version."""
    next_at: Mapped[datetime | None]
    """When the next try is due, after a failed one or while the score is held."""
    sent_at: Mapped[datetime | None]
    """When the receiver last took a delivery."""
    error: Mapped[str | None] = mapped_column(Text)
    """What the last try failed with."""
    timestamp: Mapped[datetime | None]
    """The last one given to a score, in whole seconds."""
    sent: Mapped[str | None] = mapped_column(Text)
    """The score that the platform is known to have taken, as JSON."""
    tried: Mapped[str | None] = mapped_column(Text)
    """Scores of which it is not known whether the platform took them, as a JSON list."""
    forced: Mapped[bool]
    """Whether a person asked to overwrite what the platform has."""


class NotedRow(NamedTuple):
    """A row in which a change was noted."""

    id: int
    destination: str
    has_job: bool


class LinkedColumn(NamedTuple):
    """The column of a gradebook that a platform's link leads to. `link` identifies the link in this installation, and
    `url` is the address that it names: of a line item, or of the service where the line item is looked for."""

    link: str
    url: str


_RETURNED = (Delivery.id, Delivery.destination, Delivery.has_job)


OPEN_DESTINATIONS = select(
    Destination.id, Destination.course, Destination.kind, Destination.quiz, Destination.question, Destination.url
).where(Destination.course.in_(bindparam("courses", expanding=True)), Destination.disabled_at.is_(None))


def note(session: Session, changed: Collection[LearnerAt], only: str = ALL, kind: str = ALL) -> list[NotedRow]:
    """Notes changed results for the destinations of their courses, or `only` one, or those of a `kind`. The caller
    holds the learners' locks. Adds a row for each result and destination, or counts one more change of it. The column
    of a link is a destination of those learners alone who have a row, by `expect`: they have opened the link."""
    if not changed:
        return []
    courses = {result.course for result in changed}
    wanted = [
        (destination, result)
        for destination in session.connection().execute(OPEN_DESTINATIONS, {"courses": list(courses)})
        for result in changed
        if only in (ALL, destination.id) and kind in (ALL, destination.kind) and _is_wanted(destination, result)
    ]
    keys = {_key_of_delivery(destination, result): result.course for destination, result in wanted}
    columns = {
        destination.id for destination, _ in wanted if destination.kind == SCORES and destination.url is not None
    }
    if columns:
        named = {"destinations": list(columns), "learners": [result.learner for result in changed]}
        opened = {tuple(row) for row in session.connection().execute(OPENED, named)}
        keys = {key: course for key, course in keys.items() if key[0] not in columns or key in opened}
    if not keys:
        return []
    new = {"state": WAITING, "version": 1, "noted_at": now(), "has_job": False, "attempts": 0, "forced": False}
    rows = [{**new, **dict(zip(_KEY, key, strict=True)), "course": course} for key, course in sorted(keys.items())]
    statement = _build_insert_or_count(session.get_bind().dialect.name)
    return [NotedRow(*row) for row in session.connection().execute(statement, rows)]


_KEY = ("destination", "learner", "quiz", "question")

OPENED = select(*(getattr(Delivery, name) for name in _KEY)).where(
    Delivery.destination.in_(bindparam("destinations", expanding=True)),
    Delivery.learner.in_(bindparam("learners", expanding=True)),
)


def expect(session: Session, destination_id: str, at: LearnerAt) -> None:
    """Gives a learner who has opened a link a row for its column, which has nothing to deliver yet."""
    new = {"state": SENT, "version": 0, "noted_at": now(), "has_job": False, "attempts": 0, "forced": False}
    values = {"destination": destination_id, **at._asdict(), **new}
    row = get_insert(session.get_bind().dialect.name)(Delivery).values(values)
    session.execute(row.on_conflict_do_nothing(index_elements=_KEY))


def _is_wanted(destination: Any, changed: LearnerAt) -> bool:
    return (
        destination.course == changed.course
        and destination.quiz in (ALL, changed.quiz)
        and destination.question in (ALL, changed.question)
    )


def _key_of_delivery(destination: Any, changed: LearnerAt) -> tuple[str, str, str, str]:
    """The columns `_KEY` of the row of a changed result. The scores of a whole quiz have one row."""
    question = destination.question if destination.kind == SCORES else changed.question
    return destination.id, changed.learner, changed.quiz, question


@cache
def _build_insert_or_count(dialect: str) -> Any:
    row = get_insert(dialect)(Delivery)
    held_until = and_(Delivery.state == HELD, Delivery.has_job)
    change = {"state": case((held_until, HELD), else_=WAITING), "version": Delivery.version + 1,
              "noted_at": row.excluded.noted_at, "attempts": 0, "error": None}  # fmt: skip
    return row.on_conflict_do_update(index_elements=_KEY, set_=change).returning(*_RETURNED)


def unsent_scores(session: Session) -> Sequence[tuple[str, str, str]]:
    """The (course, quiz, learner) of scores that wait or are held."""
    among = Delivery.destination.in_(_SCORES), Delivery.state.in_((WAITING, HELD)), text("state <> 'sent'")
    rows = session.execute(select(Delivery.course, Delivery.quiz, Delivery.learner).where(*among).distinct())
    return [(course, quiz, learner) for course, quiz, learner in rows]


def release_held(session: Session, course: str, quiz: str, learners: Collection[str]) -> list[NotedRow]:
    """Makes the held scores of learners in a quiz wait; returns them. Scores that wait count one more change, so that
    one that a sender is about to hold is looked at again."""
    theirs = Delivery.course == course, Delivery.learner.in_(learners), Delivery.quiz == quiz
    again = update(Delivery).where(*theirs, Delivery.destination.in_(_SCORES)).values(version=Delivery.version + 1)
    session.execute(again.where(Delivery.state == WAITING), execution_options=_UNCHANGED)
    held = again.values(state=WAITING, next_at=None).where(Delivery.state == HELD).returning(*_RETURNED)
    return [NotedRow(*row) for row in session.execute(held, execution_options=_UNCHANGED)]


MARK_QUEUED = update(Delivery).where(Delivery.id.in_(bindparam("ids", expanding=True))).values(has_job=True)


def mark_queued(session: Session, ids: Sequence[int]) -> None:
    """Says that these rows have their jobs."""
    session.connection().execute(MARK_QUEUED, {"ids": list(ids)})


_UNCHANGED = {"synchronize_session": False}
_SCORES = select(Destination.id).where(Destination.kind == SCORES)


def lock(session: Session, row_id: int) -> Delivery | None:
    """A row, locked until the transaction ends."""
    row = select(Delivery).where(Delivery.id == row_id).with_for_update().execution_options(populate_existing=True)
    return session.scalars(row).one_or_none()


def lock_delivery(session: Session, row_id: int, course: str | None) -> Delivery | None:
    """As `lock`, within a course; None for any course."""
    delivery = lock(session, row_id)
    return delivery if delivery is not None and course in (None, delivery.course) else None


def find_destination(session: Session, destination_id: str, course: str) -> Destination | None:
    """A destination of a course."""
    destination = session.get(Destination, destination_id)
    return destination if destination is not None and destination.course == course else None


def list_webhooks(session: Session, course: str) -> Sequence[Destination]:
    """The webhooks of a course, oldest first."""
    theirs = select(Destination).where(Destination.course == course, Destination.kind == WEBHOOK)
    return session.scalars(theirs.order_by(Destination.id)).all()


def make_scores_id(course: str, quiz: str, question: str, link: str | None = None) -> str:
    """The id of the destination of scores of a quiz, or of one question, that a link leads to; None for no link."""
    key = "\n".join((course, quiz, question, *([] if link is None else [link])))
    return hashlib.blake2b(key.encode(), digest_size=16).hexdigest()


def add_scores(
    session: Session, course: str, quiz: str, question: str, by: str, *, column: LinkedColumn | None = None
) -> str:
    """Makes results of a quiz, or of one question, go to learning platforms; once. With a `column` only those of
    learners who have opened its link, by `expect`. Returns the destination's id."""
    link, url = column or (None, None)
    row_id = make_scores_id(course, quiz, question, link)
    values = {"id": row_id, "course": course, "kind": SCORES, "quiz": quiz, "question": question, "url": url,
              "created_by": by, "created_at": now()}  # fmt: skip
    insert = get_insert(session.get_bind().dialect.name)(Destination).values(values)
    moved = insert.on_conflict_do_update(index_elements=["id"], set_={"url": url}, where=Destination.url != url)
    session.execute(insert.on_conflict_do_nothing() if column is None else moved)
    return row_id


def list_same_scores(session: Session, row: Delivery) -> Sequence[Delivery]:
    """The learner's other rows of scores of the same quiz or question, each for another column, oldest first."""
    theirs = (Delivery.course == row.course, Delivery.learner == row.learner, Delivery.id != row.id)
    place = (Delivery.quiz == row.quiz, Delivery.question == row.question, Delivery.destination.in_(_SCORES))
    return session.scalars(select(Delivery).where(*theirs, *place).order_by(Delivery.id)).all()


def remove(session: Session, destination: Destination) -> None:
    """Deletes a destination with its rows; their jobs find nothing."""
    session.execute(delete(Delivery).where(Delivery.destination == destination.id), execution_options=_UNCHANGED)
    session.delete(destination)


def disable(session: Session, destination_id: str, why: str) -> None:
    """Delivers nothing more to a destination. What waits for it is dead."""
    destination = session.get_one(Destination, destination_id)
    destination.disabled_at, destination.why_disabled = now(), why
    theirs = update(Delivery).where(Delivery.destination == destination_id, Delivery.state.in_((WAITING, HELD)))
    session.execute(theirs.values(state=DEAD, error=why, next_at=None), execution_options=_UNCHANGED)


def list_results(session: Session, course: str, quiz: str, learner: str) -> list[LearnerAt]:
    """The keys of a learner's results in a quiz."""
    theirs = (Result.course == course, Result.quiz == quiz, Result.learner == learner)
    rows = session.execute(select(*(getattr(Result, name) for name in LearnerAt._fields)).where(*theirs))
    return [LearnerAt(*row) for row in rows]


def page(
    session: Session, where: Sequence[ColumnElement[bool]], after: int, limit: int
) -> Sequence[tuple[Delivery, str]]:
    """At most `limit` rows after an id, in the order of ids, each with the kind of its destination."""
    rows = select(Delivery, Destination.kind).join(Destination, Destination.id == Delivery.destination)
    result = session.execute(rows.where(*where, Delivery.id > after).order_by(Delivery.id).limit(limit))
    return [(row, kind) for row, kind in result]


def list_all(session: Session, state: str, course: str | None) -> Iterator[tuple[Delivery, Destination]]:
    """Every row in a state, of one course or of all, in the order of ids, each with its destination."""
    where = [Delivery.state == state, *([Delivery.course == course] if course is not None else [])]
    after = 0
    while rows := page(session, where, after, AT_ONCE):
        for row, _ in rows:
            yield row, session.get_one(Destination, row.destination)
        after = rows[-1][0].id


def lock_dead(session: Session, destination_id: str, limit: int) -> Sequence[Delivery]:
    """At most `limit` dead rows of a destination, locked, oldest first."""
    rows = select(Delivery).where(Delivery.destination == destination_id, Delivery.state == DEAD)
    return session.scalars(rows.order_by(Delivery.id).limit(limit).with_for_update()).all()


def count_in_course(session: Session, course: str) -> dict[str, int]:
    """The number of rows of a course that are not sent, by state."""
    rows = select(Delivery.state, func.count()).where(Delivery.course == course, text("state <> 'sent'"))
    return {row[0]: row[1] for row in session.execute(rows.group_by(Delivery.state))}


def count_rows(session: Session) -> dict[tuple[str, str], int]:
    """The number of rows that are not sent, by kind and state."""
    rows = select(Destination.kind, Delivery.state, func.count()).join(Destination).where(text("state <> 'sent'"))
    grouped = session.execute(rows.group_by(Destination.kind, Delivery.state))
    return {(kind, state): count for kind, state, count in grouped}


def erase(session: Session, course: str, learner: str) -> None:
    """Deletes the rows of a learner."""
    theirs = delete(Delivery).where(Delivery.course == course, Delivery.learner == learner)
    session.execute(theirs, execution_options=_UNCHANGED)


def add_webhook(session: Session, course: str, values: dict[str, Any]) -> Destination:
    """Adds a webhook."""
    webhook = Destination(course=course, kind=WEBHOOK, quiz=ALL, question=ALL, **values)
    session.add(webhook)
    session.flush()
    return webhook
