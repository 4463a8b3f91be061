"""What belongs to the installation as a whole: its secret."""

import secrets

from sqlalchemy import delete
from sqlalchemy.orm import Session

from grader.store.database import Database
from grader.store.tables import InstallationSecret

HIDDEN_CASES = "hidden-cases"
SECRET_BYTES = 32


def hidden_case_secret(database: Database) -> bytes:
    """The key of the seeds of hidden cases; made at the first call on a database, and kept with it.

    Servers and workers that share the database share it, so that each draws the same cases for a submission. It is
    never logged and never shown.
    """
    with database.write() as session:
        database.lock(session, "installation")
        kept = session.get(InstallationSecret, HIDDEN_CASES)
        if kept is None:
            kept = InstallationSecret(name=HIDDEN_CASES, value=secrets.token_bytes(SECRET_BYTES))
            session.add(kept)
        return kept.value


def rotate_hidden_case_secret(session: Session) -> None:
    """Deletes the key of the seeds of hidden cases; servers make another when they start.

    Stored submissions keep their seeds, so a regrade draws the same cases as before.
    """
    session.execute(delete(InstallationSecret).where(InstallationSecret.name == HIDDEN_CASES))
