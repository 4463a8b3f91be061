"""The driver under SQLAlchemy, for statements where SQLAlchemy would take longer than the database does."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from sqlalchemy import Connection
from sqlalchemy.exc import DBAPIError


def driver_of(connection: Connection) -> Any:
    """The driver's own connection."""
    return connection.connection.driver_connection


@contextmanager
def as_sqlalchemy(connection: Connection) -> Iterator[None]:
    """Raises errors of the driver as SQLAlchemy does, as a DBAPIError of their kind; a lost connection is given up."""
    dialect = connection.dialect
    assert dialect.loaded_dbapi is not None
    errors = dialect.loaded_dbapi.Error
    try:
        yield
    except errors as error:
        if is_lost := dialect.is_disconnect(error, driver_of(connection), None):
            connection.invalidate(error)
        raise DBAPIError.instance(
            None, None, error, errors, hide_parameters=True, connection_invalidated=is_lost, dialect=dialect
        ) from error
