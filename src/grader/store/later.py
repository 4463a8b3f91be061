"""Statements that PostgreSQL gets together with the next one: a round trip costs more than most statements do."""

from typing import Any
from weakref import WeakKeyDictionary

from sqlalchemy import Connection, Engine, event

LATER = {"later": True}
"""Execution options of a statement whose result is not read.

On PostgreSQL it is sent with the next statement of its transaction or with the commit, and its error is raised there.
"""

BEGIN = [("BEGIN", None)]


class LaterStatements:
    """Makes an engine for PostgreSQL keep statements with `LATER` back, in their order, until the next one.

    A BEGIN is kept back too. The driver would wait for its own, so it is set to start no transactions.
    """

    def __init__(self, engine: Engine) -> None:
        self._waiting: WeakKeyDictionary[Any, list[tuple[str, Any]]] = WeakKeyDictionary()
        event.listen(engine, "connect", self._on_connect)
        event.listen(engine, "begin", self._on_begin)
        event.listen(engine, "do_execute", self._on_execute)
        event.listen(engine, "do_executemany", self._on_executemany)
        event.listen(engine, "commit", self._on_commit)
        event.listen(engine, "checkin", self._on_checkin)

    def _on_connect(self, connection: Any, _record: Any) -> None:
        connection.autocommit = True

    def _on_begin(self, connection: Connection) -> None:
        driver: Any = connection.connection.driver_connection
        if driver.autocommit and connection.get_execution_options().get("isolation_level") != "AUTOCOMMIT":
            self._waiting[driver] = BEGIN.copy()

    def _on_execute(self, cursor: Any, statement: str, parameters: Any, context: Any) -> bool:
        """Returns whether it has executed the statement, or keeps it back."""
        connection = cursor.connection
        if context.execution_options.get("later", False):
            self._waiting.setdefault(connection, []).append((statement, parameters))
            return True
        if hasattr(cursor, "name"):  # a cursor of the server, which cannot be opened together with anything else
            self._send(connection)
        if not (earlier := self._waiting.pop(connection, ())):
            return False
        with connection.pipeline():
            for one in earlier:
                connection.execute(*one)
            cursor.execute(statement, parameters)
        return True

    def _on_executemany(self, cursor: Any, _statement: str, _parameters: Any, _context: Any) -> None:
        self._send(cursor.connection)

    def _send(self, connection: Any) -> None:
        for one in self._waiting.pop(connection, ()):
            connection.execute(*one)

    def _on_commit(self, connection: Connection) -> None:
        if self._waiting.get(connection.connection.driver_connection, BEGIN) != BEGIN:
            connection.exec_driver_sql("COMMIT")  # the driver's own finds nothing more to do

    def _on_checkin(self, connection: Any, _record: Any) -> None:
        if connection is not None:  # else it was lost
            self._waiting.pop(connection, None)  # of a transaction that was rolled back
