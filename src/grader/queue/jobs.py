"""The queue as one table: jobs are put in the caller's transaction, claimed, and finished by the one who claimed them.

Topics have priorities: a job waits while one of an earlier topic is due. Within a topic, shares are fair: the waiting
jobs are ordered in rounds, and a round holds at most one job of each share (a learner). `put` gives a job the first
round in which its place is behind the head of the queue and which holds no job of its share. Since places never move
up, a share's next job waits for at most one job of every other share. A claim reads one entry of an index, however
long the queue is. Of the topic `deliver` an owner has at most one job of each share in progress: a share is a receiver,
and one that answers slowly must not take all the threads. Of the topic `grade` it has fewer jobs of a learner in
progress than threads, where it has several: a learner whose scripts sleep must not hold them all. A claim passes over
the jobs of shares that have their fill.

A job in progress has an owner, and no time limit. Times are those of the database's clock, and only jobs that were
delayed have them; a clock that is set back makes those due at once.
"""

import hashlib
import secrets
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import (
    BigInteger,
    ColumnElement,
    Float,
    Index,
    Integer,
    Select,
    String,
    and_,
    bindparam,
    case,
    delete,
    func,
    insert,
    or_,
    select,
    tuple_,
    update,
)
from sqlalchemy.ext.compiler import compiles
from sqlalchemy.orm import DeclarativeBase, Mapped, Session, mapped_column
from sqlalchemy.sql.dml import ReturningUpdate
from sqlalchemy.sql.functions import FunctionElement

from grader.store.engine.ids import age_s
from grader.store.engine.signals import announce

GRADE, REGRADE, DELIVER, PRUNE = TOPICS = ("grade", "regrade", "deliver", "prune")
"""In order of priority."""

NEWS = "jobs"
"""The channel on which new jobs are announced, by topic."""

STOPS = "stops"
"""The channel on which it is announced that jobs in progress are to stop."""


class QueueBase(DeclarativeBase):
    """The base of the queue's table, apart from the store's: a job names its subject by id."""


class JobRow(QueueBase):
    """One job. It waits while `owner` is None, and `lease` is the token of the claim in progress."""

    __tablename__ = "jobs"

    id: Mapped[int] = mapped_column(Integer, primary_key=True)
    topic: Mapped[str] = mapped_column(String(20))
    subject: Mapped[str] = mapped_column(String(64))
    priority: Mapped[int]
    """The place of the topic in `TOPICS`."""
    share: Mapped[int] = mapped_column(BigInteger)
    """The place of the share's jobs within a round."""
    round: Mapped[int]
    tries: Mapped[int]
    owner: Mapped[int | None]
    lease: Mapped[str | None] = mapped_column(String(32))
    delayed_at: Mapped[float | None] = mapped_column(Float(53))
    """When the job was last delayed, put back or released [s since 1970]; None if it never was."""
    due_at: Mapped[float | None] = mapped_column(Float(53))
    """When a delayed job is due; of a job in progress, when it was asked to stop [s since 1970]."""


ORDER = (JobRow.priority, JobRow.round, JobRow.share, JobRow.id)
WAITS, IS_OWNED = JobRow.owner.is_(None), JobRow.owner.is_not(None)
Index("ix_jobs_order", *ORDER, sqlite_where=WAITS, postgresql_where=WAITS)
Index("ix_jobs_share", JobRow.share, JobRow.priority, JobRow.round, sqlite_where=WAITS, postgresql_where=WAITS)
# Without those that wait: SQLite would else find all of them here for a claim, and sort them.
Index("ix_jobs_owner", JobRow.owner, sqlite_where=IS_OWNED, postgresql_where=IS_OWNED)


class Clock(FunctionElement[float]):
    """The database's clock [s since 1970]: all servers and workers go by the same one."""

    type = Float(53)
    inherit_cache = True


@compiles(Clock, "sqlite")
def _sqlite_clock(_element: Clock, _compiler: Any, **_kw: Any) -> str:
    return "((julianday('now') - 2440587.5) * 86400.0)"


@compiles(Clock, "postgresql")
def _postgresql_clock(_element: Clock, _compiler: Any, **_kw: Any) -> str:
    return "CAST(extract(epoch FROM clock_timestamp()) AS double precision)"


@dataclass(frozen=True)
class ClaimedJob:
    """A claimed job: its subject, the number of this try from 1, and the token that proves the claim."""

    job_id: int
    topic: str
    subject: str
    tries: int
    lease: str


def put(session: Session, topic: str, subject: str, share: str, delay_s: float = 0.0) -> None:
    """Adds a job, in the caller's transaction. Jobs of the same `share` take turns with those of the others."""
    priority, place = TOPICS.index(topic), hash_share(share)
    row = {"topic": topic, "subject": subject, "priority": priority, "share": place, "tries": 0}
    delay = {"delayed_at": Clock(), "due_at": Clock() + delay_s} if delay_s else {}
    new = insert(JobRow).values(**row, round=_choose_round(session, priority, place), **delay)
    session.connection().execute(new)
    announce(session, NEWS, topic)


def put_all(session: Session, topic: str, subjects: Sequence[str], share: str) -> None:
    """As `put`, for several jobs of one share, due at once; in three statements, however many they are."""
    if not subjects:
        return
    priority, place = TOPICS.index(topic), hash_share(share)
    row = {"topic": topic, "priority": priority, "share": place, "tries": 0}
    first = _choose_round(session, priority, place)
    rows = [{**row, "subject": subject, "round": first + number} for number, subject in enumerate(subjects)]
    session.connection().execute(insert(JobRow), rows)
    announce(session, NEWS, topic)


DUE = or_(JobRow.delayed_at.is_(None), Clock() < JobRow.delayed_at, Clock() >= JobRow.due_at)
AMONG = (
    # As a range, so that the entries of other topics in the index are not read.
    JobRow.priority.between(bindparam("from"), bindparam("to")),
    JobRow.topic.in_(bindparam("topics", expanding=True)),
)
FIRST = select(JobRow.id).where(WAITS, DUE, *AMONG).order_by(*ORDER).limit(1).with_for_update(skip_locked=True)


def _select_full(topic: str) -> Select[int]:
    """Selects the shares of which this owner has its fill of jobs of a topic in progress."""
    progress = (JobRow.owner == bindparam("by"), IS_OWNED, JobRow.priority == TOPICS.index(topic))
    fill = func.count() >= (bindparam("most", type_=Integer) if topic == GRADE else 1)
    return select(JobRow.share).where(*progress).group_by(JobRow.share).having(fill).correlate(None)


FULL = {topic: or_(JobRow.priority != TOPICS.index(topic), JobRow.share.not_in(_select_full(topic)))
        for topic in (GRADE, DELIVER)}  # fmt: skip
CLAIMS: dict[tuple[str, ...], ReturningUpdate[int, str, str, int]] = {
    topics: update(JobRow)
    .where(JobRow.id == FIRST.where(*map(FULL.__getitem__, topics)).scalar_subquery())
    .values(tries=JobRow.tries + 1, owner=bindparam("by"), lease=bindparam("new"), due_at=None)
    .returning(JobRow.id, JobRow.topic, JobRow.subject, JobRow.tries)
    for topics in ((), (GRADE,), (DELIVER,), (GRADE, DELIVER))
}
"""The claim, by the topics of which an owner has only so many jobs of a share in progress."""


def claim(session: Session, owner: int, topics: tuple[str, ...] = TOPICS, most: int | None = None) -> ClaimedJob | None:
    """Claims the first job of these topics in the queue's order that is due, for `owner`. None if there is none. With
    `most`, the owner has at most so many jobs of `grade` of one share in progress. Of an owner, two claims of
    deliveries, or with `most`, at once must not be under way: neither would see what the other one claims."""
    if not topics:
        return None
    places, lease = [TOPICS.index(topic) for topic in topics], secrets.token_hex(16)
    values: dict[str, Any] = {"from": min(places), "to": max(places), "topics": topics, "by": owner, "new": lease}
    limited = tuple(topic for topic in FULL if topic in topics and (topic == DELIVER or most is not None))
    if GRADE in limited:
        values["most"] = most
    row = session.connection().execute(CLAIMS[limited], values).first()
    return None if row is None else ClaimedJob(*row, lease)


FINISH = delete(JobRow).where(JobRow.id == bindparam("job"), JobRow.lease == bindparam("held")).returning(JobRow.id)


def finish(session: Session, claimed: ClaimedJob) -> bool:
    """Removes a job that is done. False if it was released since the claim: `take_back` may renew that."""
    return session.connection().execute(FINISH, {"job": claimed.job_id, "held": claimed.lease}).first() is not None


def take_back(session: Session, owner: int, claimed: ClaimedJob) -> bool:
    """Renews a claim that was released while its owner lived, cut off from the database: the job is the owner's again,
    and no try was lost, also where another has claimed it since. Of several claims that are in progress the earliest
    holds. False if the job is done, or waits for another reason."""
    later = or_(and_(IS_OWNED, JobRow.tries > claimed.tries), and_(WAITS, JobRow.tries == claimed.tries))
    same = (JobRow.id == claimed.job_id, JobRow.topic == claimed.topic, JobRow.subject == claimed.subject)
    stop_at = case((IS_OWNED, JobRow.due_at), else_=None)
    again = update(JobRow).where(*same, later).values(owner=owner, lease=claimed.lease, tries=claimed.tries)
    return session.execute(again.values(due_at=stop_at).returning(JobRow.id)).first() is not None


def put_back(session: Session, claimed: ClaimedJob, delay_s: float, *, tried: bool) -> bool:
    """Makes the job wait for another `delay_s` seconds. `tried` counts this try as failed. False as in `finish`."""
    tries = claimed.tries if tried else claimed.tries - 1
    again = (
        update(JobRow).where(_match_claim(claimed)).values(**_build_delay(delay_s), tries=tries).returning(JobRow.id)
    )
    announce(session, NEWS, claimed.topic)
    return session.execute(again).first() is not None


def withdraw(session: Session, topic: str, subject: str, share: str) -> bool:
    """Removes the job of a subject if it waits. False if it has been claimed, or is done."""
    waits = delete(JobRow).where(*_is_waiting(topic, share), JobRow.subject == subject).returning(JobRow.id)
    return session.execute(waits).first() is not None


def _is_waiting(topic: str, share: str) -> tuple[ColumnElement[bool], ...]:
    """The conditions on the waiting jobs of a share, which an index has, however long the queue is."""
    return WAITS, JobRow.share == hash_share(share), JobRow.priority == TOPICS.index(topic)


def ask_to_stop(session: Session, topic: str, subject: str) -> bool:
    """Asks the owner of a job in progress to stop it. False if it is done, waits, or was asked before."""
    runs = (JobRow.topic == topic, JobRow.subject == subject, IS_OWNED, JobRow.due_at.is_(None))
    job = session.execute(update(JobRow).where(*runs).values(due_at=Clock()).returning(JobRow.id)).first()
    announce(session, STOPS)
    return job is not None


def list_asked_to_stop(session: Session, owner: int) -> Sequence[str]:
    """Returns the subjects of the owner's jobs that are to stop."""
    return session.scalars(select(JobRow.subject).where(JobRow.owner == owner, JobRow.due_at.is_not(None))).all()


def hurry(session: Session, topic: str, subjects: Sequence[str]) -> None:
    """Makes the delayed jobs of these subjects due at once, but those that somebody is claiming."""
    delayed = select(JobRow.id).where(JobRow.topic == topic, JobRow.subject.in_(subjects), WAITS)
    ids = session.scalars(delayed.with_for_update(skip_locked=True)).all()
    if ids:
        session.execute(update(JobRow).where(JobRow.id.in_(ids)).values(due_at=Clock()))
        announce(session, NEWS)


def delay(session: Session, topic: str, share: str, delay_s: float) -> None:
    """Makes the waiting jobs of a share due no sooner than in `delay_s` seconds, but those that are being claimed."""
    sooner = or_(JobRow.due_at.is_(None), JobRow.due_at < Clock() + delay_s)
    waiting = select(JobRow.id).where(*_is_waiting(topic, share), sooner).with_for_update(skip_locked=True)
    later = update(JobRow).where(JobRow.id.in_(waiting)).values(**_build_delay(delay_s))
    session.execute(later, execution_options={"synchronize_session": False})


def list_owned(session: Session) -> list[tuple[int, str]]:
    """Returns the owner and the lease of every job in progress."""
    rows = session.execute(select(JobRow.owner, JobRow.lease).where(IS_OWNED))
    return [(row.owner, row.lease) for row in rows]


def release(session: Session, leases: list[str]) -> None:
    """Makes jobs in progress wait again, due at once; their claims end."""
    if leases:
        released = update(JobRow).where(JobRow.lease.in_(leases)).values(**_build_delay(0.0)).returning(JobRow.topic)
        for topic in set(session.scalars(released)):
            announce(session, NEWS, topic)


def count_jobs(session: Session, topic: str = GRADE) -> int:
    """Returns the number of jobs of a topic that are not done; those in progress count."""
    return session.scalar(select(func.count()).select_from(JobRow).where(JobRow.topic == topic)) or 0


def count_ahead(session: Session, subject: str, share: str) -> int | None:
    """How many waiting jobs of grading are claimed before that of a subject; None if its job does not wait. Reads
    these alone."""
    row = session.execute(select(*ORDER).where(*_is_waiting(GRADE, share), JobRow.subject == subject)).first()
    if row is None:
        return None
    priority, *place = row
    is_before = WAITS, JobRow.priority == priority, tuple_(*ORDER[1:]) < tuple_(*place)
    return session.scalar(select(func.count()).select_from(JobRow).where(*is_before)) or 0


@dataclass(frozen=True)
class TopicState:
    """The jobs of one topic: how many wait and run, and how long the oldest one waits [s], if it says."""

    waiting: int = 0
    running: int = 0
    oldest_s: float | None = None


def read_state(session: Session) -> dict[str, TopicState]:
    """Returns the state of the queue by topic. It reads the entries of waiting jobs in an index, and no table."""
    waits = select(JobRow.priority, func.count(), func.min(JobRow.id)).where(WAITS).group_by(JobRow.priority)
    runs = select(JobRow.topic, func.count()).where(IS_OWNED).group_by(JobRow.topic)
    waiting = {TOPICS[priority]: (count, first) for priority, count, first in session.execute(waits)}
    running = dict(session.execute(runs).all())
    first_ids = [first for _, first in waiting.values()]
    oldest = dict(session.execute(select(JobRow.topic, JobRow.subject).where(JobRow.id.in_(first_ids))).all())
    return {
        topic: TopicState(waiting.get(topic, (0,))[0], running.get(topic, 0), age_s(oldest.get(topic, "")))
        for topic in TOPICS
    }


def hash_share(share: str) -> int:
    """Returns a number of 63 bits for a share: both databases order numbers alike, and names by their collations."""
    return int.from_bytes(hashlib.blake2b(share.encode(), digest_size=8).digest(), "big") >> 1


def _choose_round(session: Session, priority: int, place: int) -> int:
    """Returns the first round in which a job at `place` is behind the head of the queue and alone in its share. Delayed
    jobs do not count: one that is tried again keeps its early place without holding back the head. If only such jobs
    are left, new ones join the last of their rounds."""
    behind, after = session.connection().execute(ROUND, {"of": priority, "place": place}).one()
    return int(behind if after is None else max(behind, after))


def _select_round() -> Select[Any]:
    of, place = bindparam("of", type_=Integer), bindparam("place", type_=BigInteger)
    new = (JobRow.priority == of, WAITS, JobRow.delayed_at.is_(None))
    head = select(JobRow.round + case((JobRow.share > place, 1), else_=0)).where(*new).order_by(*ORDER).limit(1)
    own = select(func.max(JobRow.round) + 1).where(*new, JobRow.share == place)
    last = select(func.max(JobRow.round)).where(JobRow.priority == of)
    # Both databases come to `last` only without a head: it reads the jobs in progress too, which no index orders.
    first = func.coalesce(head.scalar_subquery(), last.scalar_subquery(), 0)
    return select(first, own.scalar_subquery())


ROUND = _select_round()


def _match_claim(claimed: ClaimedJob) -> Any:
    return and_(JobRow.id == claimed.job_id, JobRow.lease == claimed.lease)


def _build_delay(delay_s: float) -> dict[str, Any]:
    return {"owner": None, "lease": None, "delayed_at": Clock(), "due_at": Clock() + delay_s}
