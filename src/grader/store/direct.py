"""Queries that go to the driver as they are: SQLAlchemy would take longer with them than the database does."""

from collections import namedtuple
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Boolean, Connection, Dialect, Select, TypeDecorator

from grader.store.driver import as_sqlalchemy, driver_of
from grader.store.later import run


@dataclass(frozen=True)
class _Compiled:
    """A statement of one database: its parameters by name or in their order, and what converts its columns."""

    statement: str
    given: dict[str, Any]
    order: Sequence[str] | None
    converters: Sequence[tuple[int, Callable[[Any], Any]]]

    def parameters(self, given: dict[str, Any]) -> Any:
        """Those of the statement itself, and the given ones."""
        every = self.given | given
        return every if self.order is None else [every[name] for name in self.order]


class DirectQuery:
    """A query that is compiled once for each database. Its parameters are texts and numbers."""

    def __init__(self, query: Select[Any]) -> None:
        self._query = query
        self._row: Any = namedtuple("Row", [column.name for column in query.selected_columns])  # type: ignore[misc]
        self._compiled: dict[str, _Compiled] = {}

    def rows(self, connection: Connection, **given: Any) -> Sequence[Any]:
        """The rows, whose values bear the names of their columns. Raises DBAPIError."""
        name = connection.dialect.name
        if name not in self._compiled:
            self._compiled[name] = self._compile(connection.dialect)
        compiled = self._compiled[name]
        parameters = compiled.parameters(given)
        if name == "sqlite":
            with as_sqlalchemy(connection):
                found = driver_of(connection).execute(compiled.statement, parameters).fetchall()
        else:
            found = run(connection, compiled.statement, parameters).fetchall()
        return [self._row(*_converted(row, compiled.converters)) for row in found]

    def _compile(self, dialect: Dialect) -> _Compiled:
        compiled: Any = self._query.compile(dialect=dialect)
        types = [(place, column.type) for place, column in enumerate(self._query.selected_columns)]
        converters = [
            (place, one.dialect_impl(dialect).result_processor(dialect, None))
            for place, one in types
            if isinstance(one, Boolean | TypeDecorator)  # drivers give texts and numbers as they are
        ]
        return _Compiled(
            str(compiled),
            compiled.params,
            compiled.positiontup if compiled.positional else None,
            [(place, convert) for place, convert in converters if convert is not None],
        )


def _converted(row: Sequence[Any], converters: Sequence[tuple[int, Callable[[Any], Any]]]) -> Sequence[Any]:
    if not converters:
        return row
    values = list(row)
    for place, convert in converters:
        values[place] = convert(values[place])
    return values
