"""The line items of learning platforms that this installation has found or created: the table and its queries. A row is
made once for each line items service and resource. The holder of its lease looks the line item up; all others wait for
what it finds, so that no line item is created twice."""

import hashlib
from datetime import datetime, timedelta
from typing import NamedTuple

from sqlalchemy import String, Text, delete, select, update
from sqlalchemy.dialects import postgresql, sqlite
from sqlalchemy.orm import Mapped, Session, mapped_column

from grader.store.tables import Base, now


class LineItem(Base):
    """A column of a platform's gradebook."""

    __tablename__ = "line_items"

    id: Mapped[str] = mapped_column(String(32), primary_key=True)
    """A digest of the two columns that follow."""
    container: Mapped[str] = mapped_column(Text)
    """The URL of the line items service of a context."""
    resource: Mapped[str] = mapped_column(Text)
    """The `resourceId`."""
    url: Mapped[str | None] = mapped_column(Text)
    """The URL of the line item; None until it is found or created."""
    leased_until: Mapped[datetime | None]


class LineItemPlace(NamedTuple):
    """A resource in a context of a platform."""

    container: str
    resource: str

    @property
    def id(self) -> str:
        """The key of its row."""
        return hashlib.blake2b("\n".join(self).encode(), digest_size=16).hexdigest()


class Lease(NamedTuple):
    """What is known of a line item: its URL, or else whether the caller is the one who looks it up."""

    url: str | None
    is_ours: bool


def lease(session: Session, place: LineItemPlace, lasting: timedelta) -> Lease:
    """The URL of a line item, or the right to look it up and create it for a while, if it is free."""
    dialect = {"sqlite": sqlite, "postgresql": postgresql}[session.get_bind().dialect.name]
    row = {"id": place.id, "container": place.container, "resource": place.resource}
    session.execute(dialect.insert(LineItem).values(row).on_conflict_do_nothing())
    line_item = session.scalars(select(LineItem).where(LineItem.id == place.id).with_for_update()).one()
    if line_item.url is not None or (line_item.leased_until is not None and line_item.leased_until > now()):
        return Lease(line_item.url, is_ours=False)
    line_item.leased_until = now() + lasting
    return Lease(None, is_ours=True)


def keep(session: Session, place: LineItemPlace, url: str | None) -> None:
    """Ends the lease with what was found; None if it was not."""
    session.execute(update(LineItem).where(LineItem.id == place.id).values(url=url, leased_until=None))


def forget(session: Session, place: LineItemPlace) -> None:
    """Forgets a line item that the platform no longer has."""
    session.execute(delete(LineItem).where(LineItem.id == place.id))
