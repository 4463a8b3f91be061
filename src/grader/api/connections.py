"""HTTP/1.1 connections that are closed when a request does not arrive, or a response is not read, in time."""

import asyncio
from typing import Any

from httptools import HttpParserError, HttpParserUpgrade, HttpRequestParser
from uvicorn.protocols.http.httptools_impl import STATUS_LINE, HttpToolsProtocol, RequestResponseCycle

HEAD_BYTES_MAX = 64 * 1024
"""Longest headers; as many bytes may come in before headers, the size of a chunk or the trailers are complete."""

WAITING_MAX = 100
"""Requests that may wait on one connection for the one before them to be answered."""

FRAMING = (b"content-length", b"transfer-encoding")
"""Headers that say where a body ends."""


class TimedProtocol(HttpToolsProtocol):
    """uvicorn's protocol with limits; its own cover only the pause between two requests.

    The headers of a request, and then its body, must each arrive whole within `arrival_s` [s], however steadily they
    trickle in: otherwise 408, and the connection is closed. A client that does not read its response is cut off after
    `reading_s` [s]. Headers are limited in size, as are requests that wait; the trailers of a body are not read.
    """

    arrival_s = 20.0
    reading_s = 30.0

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._arrival: asyncio.TimerHandle | None = None
        self._reading: asyncio.TimerHandle | None = None
        self._arrives_by = 0.0
        self._is_in_head = self._is_in_body = self._is_ahead = self._is_repeated = False
        self._undone = 0

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Starts to wait for the first request."""
        super().connection_made(transport)
        self._begin_part()
        self._arrival = self.loop.call_later(self.arrival_s, self._look_at_arrival)

    def connection_lost(self, exc: Exception | None) -> None:
        """Stops every timer."""
        super().connection_lost(exc)
        for timer in (self._arrival, self._reading):
            if timer is not None:
                timer.cancel()

    def pause_writing(self) -> None:
        """Starts to wait for the client to read."""
        super().pause_writing()
        self._reading = self.loop.call_later(self.reading_s, self.transport.abort)

    def resume_writing(self) -> None:
        """Stops waiting for the client to read."""
        super().resume_writing()
        if self._reading is not None:
            self._reading.cancel()

    def data_received(self, data: bytes) -> None:
        """Reads what has come in."""
        self._unset_keepalive_if_required()
        self._is_ahead = False
        self._feed(data)
        self._undone = 0 if self._is_ahead else self._undone + len(data)
        if self._undone > HEAD_BYTES_MAX:
            self._refuse(431)

    def _feed(self, data: bytes) -> None:
        try:
            self.parser.feed_data(data)
        except HttpParserUpgrade as offer:
            self._stay_with_http()
            self._feed(data[offer.args[0] :])
        except HttpParserError:
            self.send_400_response("Invalid HTTP request received.")

    def _stay_with_http(self) -> None:
        """Goes on after headers that offer another protocol: their parser would read no body, and nothing behind it."""
        framing = [b"%b: %b\r\n" % header for header in self.headers if header[0] in FRAMING]
        self.parser = HttpRequestParser(self)
        self.parser.set_dangerous_leniencies(lenient_data_after_close=True)  # as uvicorn: what follows is not read
        self._is_repeated = True
        self.parser.feed_data(b"POST / HTTP/1.1\r\n%b\r\n" % b"".join(framing))

    def send_400_response(self, msg: str) -> None:
        """Answers 400 to a request that cannot be parsed, and closes the connection."""
        if self._may_answer():
            super().send_400_response(msg)
        self._close()

    def on_message_begin(self) -> None:
        """Notes the first byte of a request."""
        if not self._is_repeated:
            super().on_message_begin()
            self._is_in_head = self._is_ahead = True

    def on_url(self, url: bytes) -> None:
        """Notes the target of a request."""
        if not self._is_repeated:
            super().on_url(url)

    def on_header(self, name: bytes, value: bytes) -> None:
        """Notes a header, but no trailer: a proxy would not have looked at it."""
        if self._is_in_head:
            super().on_header(name, value)

    def on_headers_complete(self) -> None:
        """Starts to answer, and to wait for the body. Raises OverflowError for a request too large or too many."""
        if self._is_repeated:
            self._is_repeated = False
            return
        if len(self.pipeline) >= WAITING_MAX:
            raise OverflowError("too many requests wait on one connection")
        if sum(len(name) + len(value) for name, value in self.headers) > HEAD_BYTES_MAX:
            raise OverflowError("the headers are too large")
        super().on_headers_complete()
        self._is_in_head, self._is_in_body, self._is_ahead = False, True, True
        self._begin_part()

    def on_body(self, body: bytes) -> None:
        """Takes a part of the body."""
        super().on_body(body)
        self._is_ahead = True

    def on_message_complete(self) -> None:
        """Starts to wait for the next request."""
        if self.parser.should_upgrade():  # its body is read by the next parser
            return
        super().on_message_complete()
        self._is_in_body, self._is_ahead = False, True
        self._begin_part()

    def on_response_complete(self) -> None:
        """Starts to wait for the next request, unless the body of this one is still coming in."""
        super().on_response_complete()
        if not self._is_in_body:
            self._begin_part()

    def _begin_part(self) -> None:
        """Starts the time anew for each part of a request: its headers, then its body."""
        self._arrives_by = self.loop.time() + self.arrival_s

    def _look_at_arrival(self) -> None:
        """Refuses a request that is late. The time does not run while an earlier one is answered."""
        if self._is_answering():
            self._begin_part()
        left_s = self._arrives_by - self.loop.time()
        if left_s <= 0:
            self._refuse(408)
        else:
            self._arrival = self.loop.call_later(left_s, self._look_at_arrival)

    def _is_answering(self) -> bool:
        """Whether an earlier request than the one that comes in is being answered."""
        if self._is_in_body:
            return bool(self.pipeline) and self.pipeline[0][0] is self.cycle
        last: RequestResponseCycle | None = self.cycle
        return last is not None and not last.response_complete

    def _may_answer(self) -> bool:
        """Whether a response to what comes in would be the next on the connection, and has not begun."""
        return not (self._is_answering() or (self._is_in_body and self.cycle.response_started))

    def _refuse(self, status: int) -> None:
        """Answers a request that comes in unless a response has begun, and closes the connection."""
        if (self._is_in_head or self._is_in_body) and self._may_answer():
            self.transport.write(STATUS_LINE[status] + b"content-length: 0\r\nconnection: close\r\n\r\n")
        self._close()

    def _close(self) -> None:
        """Closes the connection; a request whose body has not arrived is not answered any more."""
        if self._is_in_body:
            self.cycle.disconnected = True
            self.cycle.message_event.set()
        self.transport.close()
