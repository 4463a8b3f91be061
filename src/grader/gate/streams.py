"""The open event streams of each user: a connection and a reader of each event for every one, so they are limited."""

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager

STREAMS_MAX = 32
"""Open streams of one user in one process, enough for as many pages."""


class Streams:
    """Ends the oldest stream of a user who opens too many. For the event loop."""

    def __init__(self) -> None:
        self._open: dict[str, list[asyncio.Event]] = {}

    @contextmanager
    def open(self, user: str) -> Iterator[asyncio.Event]:
        """A place among the streams of the user with this id, as an event that wakes the stream."""
        mine, place = self._open.setdefault(user, []), asyncio.Event()
        mine.append(place)
        if len(mine) > STREAMS_MAX:
            mine.pop(0).set()
        try:
            yield place
        finally:
            if place in mine:
                mine.remove(place)
            if not mine and self._open.get(user) is mine:
                del self._open[user]

    def is_open(self, user: str, place: asyncio.Event) -> bool:
        """Whether the stream in this place may go on."""
        return place in self._open.get(user, ())
