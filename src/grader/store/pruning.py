"""Deletes what only recent requests need: idempotency keys, and events that a later one has followed."""

from datetime import timedelta
from typing import Any, cast

from sqlalchemy import CursorResult, Delete, delete, func, select, tuple_
from sqlalchemy.orm import aliased

from grader.store.database import Database
from grader.store.submissions import AT_REST
from grader.store.tables import Event, IdempotencyKey, Submission, now

AT_ONCE = 500
"""Keys, and submissions whose events are looked at, in one transaction: nobody waits long for it."""


def prune(database: Database, age: timedelta) -> int:
    """Deletes in small transactions what is older than `age`. Returns the number of rows.

    The last event of a submission stays, so that a late listener hears how it was graded, and later events are
    numbered on. A repeated request whose key is gone makes a new submission.
    """
    before = now() - age
    deleted, start = 0, ""
    key = (IdempotencyKey.course, IdempotencyKey.learner, IdempotencyKey.key)
    oldest = select(*key).where(IdempotencyKey.created_at < before).order_by(IdempotencyKey.created_at).limit(AT_ONCE)
    while (count := _delete(database, delete(IdempotencyKey).where(tuple_(*key).in_(oldest)))) > 0:
        deleted += count
    while ids := _at_rest(database, start):
        later = aliased(Event)
        last = select(func.max(later.number)).where(later.submission_id == Event.submission_id).scalar_subquery()
        followed = (Event.submission_id.in_(ids), Event.created_at < before, Event.number < last)
        deleted += _delete(database, delete(Event).where(*followed))
        start = ids[-1]
    return deleted


def _at_rest(database: Database, start: str) -> list[str]:
    """The ids of the next submissions with more than one event and a verdict."""
    with database.read() as session:
        several = select(Event.submission_id).where(Event.submission_id > start).group_by(Event.submission_id)
        done = several.join(Submission, Submission.id == Event.submission_id).where(Submission.status.in_(AT_REST))
        page = done.having(func.count() > 1).order_by(Event.submission_id).limit(AT_ONCE)
        return list(session.scalars(page))


def _delete(database: Database, rows: Delete) -> int:
    with database.write() as session:
        done = session.execute(rows.execution_options(synchronize_session=False))
        return cast(CursorResult[Any], done).rowcount
