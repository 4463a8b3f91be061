"""What belongs to the installation as a whole: its secrets, and the origin at which browsers reach it."""

import secrets

from sqlalchemy import delete
from sqlalchemy.orm import Session

from grader.store.engine.bulk import get_insert
from grader.store.engine.database import Database
from grader.store.tables import InstallationFact, InstallationSecret

HIDDEN_CASES, BLIND_REVIEWS, LTI_KEYS = "hidden-cases", "blind-reviews", "lti-keys"
ORIGIN = "origin"
SECRET_BYTES = 32


def hidden_case_secret(database: Database) -> bytes:
    """The key of the seeds of hidden cases. Servers and workers that share the database share it, so that each draws
    the same cases for a submission."""
    return _secret(database, HIDDEN_CASES)


def blind_review_secret(database: Database) -> bytes:
    """The key of the pseudonyms that reviewers see, and of the draw of answers that are marked a second time."""
    return _secret(database, BLIND_REVIEWS)


def _secret(database: Database, name: str) -> bytes:
    """The secret of this name; made at the first call on a database, kept with it, never logged and never shown."""
    with database.write() as session:
        database.lock(session, "installation")
        secret = session.get(InstallationSecret, name)
        if secret is None:
            secret = InstallationSecret(name=name, value=secrets.token_bytes(SECRET_BYTES))
            session.add(secret)
        return secret.value


def note_origin(session: Session, origin: str) -> None:
    """Keeps the origin at which the server that has just started is reached. Several servers may start at once."""
    row = get_insert(session.get_bind().dialect.name)(InstallationFact).values(name=ORIGIN, value=origin)
    session.execute(row.on_conflict_do_update(index_elements=["name"], set_={"value": origin}))


def find_origin(session: Session) -> str | None:
    """The origin of the server that started last; None before the first start."""
    fact = session.get(InstallationFact, ORIGIN)
    return None if fact is None else fact.value


def lti_keys(session: Session) -> bytes | None:
    """The private keys with which this tool signs for learning platforms, as `lms.keys` wrote them; None before."""
    secret = session.get(InstallationSecret, LTI_KEYS)
    return None if secret is None else secret.value


def keep_lti_keys(session: Session, value: bytes) -> None:
    """Replaces the private keys for learning platforms."""
    session.merge(InstallationSecret(name=LTI_KEYS, value=value))


def rotate_hidden_case_secret(session: Session) -> None:
    """Deletes the key of the seeds of hidden cases; servers make another when they start. Stored submissions keep their
    seeds, so a regrade draws the same cases as before."""
    session.execute(delete(InstallationSecret).where(InstallationSecret.name == HIDDEN_CASES))
