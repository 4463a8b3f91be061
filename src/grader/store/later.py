"""Statements that PostgreSQL gets together with the next one: a round trip costs more than most statements do."""

from typing import Any
from weakref import WeakKeyDictionary

from sqlalchemy import Connection, Engine, event

from grader.store.driver import as_sqlalchemy, driver_of

LATER = {"later": True}
"""Execution options of a statement whose result is not read.

On PostgreSQL it is sent with the next statement of its transaction or with the commit, and its error is raised there.
"""

BEGIN, BEGIN_READING = [("BEGIN", None)], [("BEGIN READ ONLY", None)]

_kept_back: WeakKeyDictionary[Any, list[tuple[str, Any]]] = WeakKeyDictionary()
"""By the driver's connection."""


def keep_back(connection: Connection, statement: str, parameters: Any) -> None:
    """As to execute a statement with `LATER` on PostgreSQL, but past SQLAlchemy: that would take longer."""
    _kept_back.setdefault(driver_of(connection), []).append((statement, parameters))


def run(connection: Connection, statement: str, parameters: Any) -> Any:
    """The driver's cursor of a statement of PostgreSQL that goes past SQLAlchemy, with what was kept back.

    Raises DBAPIError.
    """
    with as_sqlalchemy(connection):
        cursor = driver_of(connection).cursor()
        if not _run_together(cursor, statement, parameters):
            cursor.execute(statement, parameters)
        return cursor


def _run_together(cursor: Any, statement: str, parameters: Any) -> bool:
    """Runs a statement with those that were kept back, if any were; returns whether it did."""
    driver = cursor.connection
    earlier = _kept_back.pop(driver, None)
    if earlier is None:
        return False
    with driver.pipeline():
        for one in earlier:
            driver.execute(*one)
        cursor.execute(statement, parameters)
    return True


class LaterStatements:
    """Makes an engine for PostgreSQL keep statements with `LATER` back, in their order, until the next one.

    A BEGIN is kept back too. The driver would wait for its own, so it is set to start no transactions.

    A transaction with the option `reads` ends with a COMMIT: after a ROLLBACK the driver forgets the statements that it
    has prepared, and those of the next transactions are parsed and planned anew.
    """

    def __init__(self, engine: Engine) -> None:
        event.listen(engine, "connect", self._on_connect)
        event.listen(engine, "begin", self._on_begin)
        event.listen(engine, "do_execute", self._on_execute)
        event.listen(engine, "do_executemany", self._on_executemany)
        event.listen(engine, "commit", self._on_commit)
        event.listen(engine, "rollback", self._on_rollback)
        event.listen(engine, "checkin", self._on_checkin)

    def _on_connect(self, connection: Any, _record: Any) -> None:
        connection.autocommit = True

    def _on_begin(self, connection: Connection) -> None:
        driver = driver_of(connection)
        options = connection.get_execution_options()
        if driver.autocommit and options.get("isolation_level") != "AUTOCOMMIT":
            _kept_back[driver] = (BEGIN_READING if options.get("reads", False) else BEGIN).copy()

    def _on_execute(self, cursor: Any, statement: str, parameters: Any, context: Any) -> bool:
        """Returns whether it has executed the statement, or keeps it back."""
        if context.execution_options.get("later", False):
            _kept_back.setdefault(cursor.connection, []).append((statement, parameters))
            return True
        if hasattr(cursor, "name"):  # a cursor of the server, which cannot be opened together with anything else
            self._send(cursor.connection)
        return _run_together(cursor, statement, parameters)

    def _on_executemany(self, cursor: Any, _statement: str, _parameters: Any, _context: Any) -> None:
        self._send(cursor.connection)

    def _send(self, driver: Any) -> None:
        for one in _kept_back.pop(driver, ()):
            driver.execute(*one)

    def _on_commit(self, connection: Connection) -> None:
        if _kept_back.get(driver_of(connection), BEGIN) != BEGIN:
            run(connection, "COMMIT", None)  # the driver's own finds nothing more to do

    def _on_rollback(self, connection: Connection) -> None:
        if not connection.get_execution_options().get("reads", False) or connection.invalidated:
            return
        if driver_of(connection).info.transaction_status.name == "INTRANS":
            run(connection, "COMMIT", None)  # the driver's own rollback finds nothing more to do

    def _on_checkin(self, connection: Any, _record: Any) -> None:
        if connection is not None:  # else it was lost
            _kept_back.pop(connection, None)  # of a transaction that was rolled back
