"""Every query on idempotency keys: which submission a learner's request with a key has made."""

from collections.abc import Collection
from typing import NamedTuple

from sqlalchemy import delete, select
from sqlalchemy.orm import Session

from grader.store.engine.keys import read_by_keys
from grader.store.tables import IdempotencyKey

Key = tuple[str, str, str]
"""Course, learner and the key itself: the primary key."""


class EarlierRequest(NamedTuple):
    """What the first request with a key has made."""

    request_digest: str
    submission_id: str
    http_status: int


COLUMNS = (IdempotencyKey.course, IdempotencyKey.learner, IdempotencyKey.key)
EVERY = select(*COLUMNS, IdempotencyKey.request_digest, IdempotencyKey.submission_id, IdempotencyKey.http_status)


def find(session: Session, keys: Collection[Key]) -> dict[Key, EarlierRequest]:
    """The first requests of those keys that were used; in one query, however many they are."""
    rows = read_by_keys(session, EVERY, COLUMNS, keys)
    return {(course, learner, key): EarlierRequest(*made) for course, learner, key, *made in rows}


def forget(session: Session, submission_id: str) -> None:
    """Lets the keys of a submission make another one."""
    session.execute(delete(IdempotencyKey).where(IdempotencyKey.submission_id == submission_id))
