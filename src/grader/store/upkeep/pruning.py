"""Deletes expired and superseded rows: one function a table, in small transactions, so that no request waits long."""

from collections.abc import Sequence
from datetime import datetime, timedelta
from typing import Any

from sqlalchemy import Select, bindparam, delete, exists, select, tuple_
from sqlalchemy.orm import InstrumentedAttribute, aliased

from grader.store import credentials, people
from grader.store.engine.database import Database
from grader.store.outbox import SENT, WEBHOOK, Delivery, Destination
from grader.store.submissions import AT_REST
from grader.store.tables import Base, Event, IdempotencyKey, Submission, now
from grader.store.tickets import Ticket

BATCH = 500
"""Rows that one transaction deletes."""


def prune(database: Database, age: timedelta) -> int:
    """Deletes idempotency keys, events and webhook deliveries older than `age`, expired tickets. Returns how many."""
    before = now() - age
    old = idempotency_keys(database, before) + prune_events(database, before) + prune_deliveries(database, before)
    return old + expired_tickets(database, now())


def idempotency_keys(database: Database, before: datetime) -> int:
    """Deletes the keys of requests from before a time: sent again, they would be new. Returns how many."""
    row = IdempotencyKey
    return _delete(database, row, [row.course, row.learner, row.key], select(row).where(row.created_at < before))


def prune_events(database: Database, before: datetime) -> int:
    """Deletes events from before a time, but the last of each submission, where it is graded. Returns how many. So a
    late listener still hears how it was graded, and later events are numbered on."""
    later = aliased(Event)
    followed = exists().where(later.submission_id == Event.submission_id, later.number > Event.number)
    graded = select(Event).join(Submission, Submission.id == Event.submission_id).where(Submission.status.in_(AT_REST))
    passed = graded.where(Event.created_at < before, followed)
    return _delete(database, Event, [Event.submission_id, Event.number], passed)


def expired_tickets(database: Database, before: datetime) -> int:
    """Deletes tickets that expired before a time, such as logins that were never answered. Returns how many."""
    return _delete(database, Ticket, [Ticket.hash], select(Ticket).where(Ticket.expires_at < before))


def prune_deliveries(database: Database, before: datetime) -> int:
    """Deletes deliveries to webhooks that were sent before a time. Returns how many. Those of scores stay: they tell
    our own score at a platform from a person's."""
    rows = select(Delivery).join(Destination, Destination.id == Delivery.destination)
    sent = rows.where(Destination.kind == WEBHOOK, Delivery.state == SENT, Delivery.sent_at < before)
    return _delete(database, Delivery, [Delivery.id], sent)


def ended_credentials(database: Database, kinds: Sequence[str], before: datetime) -> int:
    """Deletes credentials that were revoked or had expired before a time, and members who had no other way back.
    Returns how many credentials there were."""
    count = 0
    while True:
        with database.write() as session:
            members = credentials.prune(session, kinds, before)
            people.prune(session, members)
        if not members:
            return count
        count += len(members)


def _delete(
    database: Database, table: type[Base], key: Sequence[InstrumentedAttribute[Any]], wanted: Select[Any]
) -> int:
    """Deletes the wanted rows in the order of their keys; they are looked for outside of the writing transactions."""
    count, order, names = 0, tuple_(*key), [f"{column.key}_of_row" for column in key]
    # Row by row: for a list of composite keys SQLite reads the whole table.
    deletion = delete(table).where(*(column == bindparam(name) for column, name in zip(key, names, strict=True)))
    following = wanted.with_only_columns(*key).order_by(*key).limit(BATCH)
    rest = following
    while True:
        with database.read() as session:
            keys = session.execute(rest).all()
        if not keys:
            return count
        with database.write() as session:
            session.connection().execute(deletion, [dict(zip(names, row, strict=True)) for row in keys])
        count, rest = count + len(keys), following.where(order > keys[-1])
