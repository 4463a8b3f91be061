"""HTTP/1.1 connections that are closed when a request does not arrive, or a response is not read, in time."""

import asyncio
from typing import Any

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol


class TimedProtocol(H11Protocol):
    """uvicorn's protocol with time limits; its own covers only the pause between two requests.

    The headers of a request, and then its body, must each arrive whole within `arrival_s` [s], however steadily they
    trickle in: otherwise 408, and the connection is closed. A client that does not read its response is cut off after
    `reading_s` [s].
    """

    arrival_s = 20.0
    reading_s = 30.0

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._arrival: asyncio.TimerHandle | None = None
        self._reading: asyncio.TimerHandle | None = None
        self._phase: Any = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Starts to wait for the first request."""
        super().connection_made(transport)
        self._watch_arrival()

    def handle_events(self) -> None:
        """Reads what has come in; called too when a response is complete."""
        super().handle_events()
        self._watch_arrival()

    def pause_writing(self) -> None:
        """Starts to wait for the client to read."""
        super().pause_writing()
        self._reading = self.loop.call_later(self.reading_s, self.transport.abort)

    def resume_writing(self) -> None:
        """Stops waiting for the client to read."""
        super().resume_writing()
        if self._reading is not None:
            self._reading.cancel()

    def connection_lost(self, exc: Exception | None) -> None:
        """Stops every timer."""
        super().connection_lost(exc)
        for timer in (self._arrival, self._reading):
            if timer is not None:
                timer.cancel()

    def _watch_arrival(self) -> None:
        """Starts the time anew for each part of a request: its headers, then its body."""
        phase = self.conn.their_state, self.cycle
        if phase == self._phase:
            return
        self._phase = phase
        if self._arrival is not None:
            self._arrival.cancel()
        if self.conn.their_state in (h11.IDLE, h11.SEND_BODY):
            self._arrival = self.loop.call_later(self.arrival_s, self._refuse)

    def _refuse(self) -> None:
        """Answers 408 unless a response has begun, and closes the connection."""
        is_in_body = self.conn.their_state is h11.SEND_BODY
        if (is_in_body or self.conn.trailing_data[0]) and self.conn.our_state in (h11.IDLE, h11.SEND_RESPONSE):
            headers = [("Content-Length", "0"), ("Connection", "close")]
            output = self.conn.send(h11.Response(status_code=408, headers=headers, reason="Request Timeout"))
            self.transport.write(output or b"")
        if is_in_body:
            self.cycle.disconnected = True  # the app must not answer as well
            self.cycle.message_event.set()
        self.transport.close()
