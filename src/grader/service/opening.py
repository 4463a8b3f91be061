"""What a server or worker does first: it warns of an untested MuJoCo, and opens the database once it answers."""

import gc
import time
from collections.abc import Callable
from contextlib import ExitStack

import structlog
from sqlalchemy.exc import OperationalError

from grader.errors import Unprocessable
from grader.numerics.version import warn_of_newer
from grader.settings import Settings
from grader.store.engine.database import Database
from grader.store.engine.unusable import find_cure, naming, put_on_a_line

RETRY_S = 1.0
"""Pause before the next try to reach the database [s]."""

SAY_S = 30.0
"""Pause between two lines of the log that say so [s]."""

YOUNG_OBJECTS = 10_000
"""New objects between two looks for garbage cycles; Python's own 700 cost a tenth of every request."""

SETTING = "GRADER_DATABASE_URL"

POOLED = (
    "GRADER_DATABASE_URL leads to a pooler that shares connections between transactions, such as PgBouncer in "
    "transaction mode: locks and signals get lost there. Connect to PostgreSQL itself, or to PgBouncer in session mode."
)

log = structlog.get_logger()


def never() -> bool:
    """Says that nobody ends the process: whoever waits here is ended by the signal itself."""
    return False


def open_database(settings: Settings, is_ending: Callable[[], bool] = never) -> Database:
    """Opens the database of the settings with the newest tables; waits for a PostgreSQL that does not answer yet, and
    warns of a MuJoCo that is newer than tested. Raises Unprocessable behind a pooler without sessions, Conflict if a
    later version has written the tables, and InterruptedError once `is_ending` while it waits."""
    if warning := warn_of_newer():
        log.warning("untested MuJoCo", why=warning)
    database = Database(settings.database, settings.connections)
    with naming(settings.database), ExitStack() as opened:
        opened.callback(database.close)
        if not database.is_sqlite:
            wait_until_there(database, is_ending)
        if not database.keeps_sessions():
            raise Unprocessable(POOLED)
        database.hold()
        database.migrate()
        opened.pop_all()
    return database


def wait_until_there(database: Database, is_ending: Callable[[], bool]) -> None:
    """Waits until the database accepts a connection; the log says for which one, why it is refused, and the cure where
    it is known. Raises InterruptedError once `is_ending`."""
    say_at = time.monotonic()
    while not is_ending():
        try:
            database.engine.connect().close()
            return
        except OperationalError as error:
            if time.monotonic() >= say_at:
                url, why = database.engine.url, put_on_a_line(error.orig)
                address = url.query.get("host") or f"{url.host or 'localhost'}:{url.port or 5432}"
                more = {"cure": cure} if (cure := find_cure(url, why)) else {}
                log.warning(
                    "waiting for the database", host=address, name=url.database, why=why, setting=SETTING, **more
                )
                say_at += SAY_S
            time.sleep(RETRY_S)
    raise InterruptedError("The server was ended while it waited for the database.")


def end_start() -> None:
    """Leaves all that is there out of every look for garbage, which then comes often. A last look at it would take a
    tenth of a second."""
    gc.freeze()
    gc.set_threshold(YOUNG_OBJECTS)
