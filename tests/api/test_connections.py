"""Connections that send or read too slowly, or send too much, are closed; honest ones are served meanwhile.

With real sockets.
"""

import socket
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import httpx
import pytest
from starlette.types import Receive, Scope, Send

from grader.api.connections import HEAD_BYTES_MAX, WAITING_MAX, TimedProtocol
from grader.app import create_app, server_config
from grader.settings import Settings
from servers import serving
from sites import write_content

pytestmark = pytest.mark.slow

HEAD = b"POST /api/v1/submissions HTTP/1.1\r\nHost: localhost\r\nContent-Length: 100\r\n"
HALVES = {
    "nothing": b"",
    "a method": b"POST /api",
    "half of the headers": HEAD,
    "half of a body": b"POST /signin HTTP/1.1\r\nHost: localhost\r\nContent-Length: 100\r\n\r\ncode=",
    "half of a body without a token": HEAD + b"\r\n{",
    "half of a body that nobody reads": b"POST /healthz HTTP/1.1\r\nHost: localhost\r\nContent-Length: 9\r\n\r\n{",
}


class Hasty(TimedProtocol):
    """Time limits that a test can wait for."""

    arrival_s = 0.6
    reading_s = 0.6


@pytest.fixture(scope="module")
def origin(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    folder = tmp_path_factory.mktemp("hasty")
    settings = Settings(
        content=write_content(folder / "content"), data=folder / "data", workers=0, address_rate_burst=10**9
    )
    app = create_app(settings)
    with serving(app, http=Hasty) as origin:
        yield origin
    app.state.context.database.close()


@pytest.fixture
def connect(origin: str) -> Iterator[Callable[..., socket.socket]]:
    with ExitStack() as sockets:

        def connect(sent: bytes, **options: Any) -> socket.socket:
            address = urlsplit(origin)
            connection = socket.create_connection((address.hostname, address.port), timeout=20)
            sockets.enter_context(connection)
            connection.sendall(sent)
            return connection

        yield connect


def received(connection: socket.socket) -> bytes:
    """Everything until the server closes the connection."""
    parts = []
    try:
        while part := connection.recv(65536):
            parts.append(part)
    except ConnectionResetError:
        pass
    return b"".join(parts)


@pytest.mark.parametrize(
    ("half", "status"),
    [
        ("nothing", b""),
        ("a method", b"408"),
        ("half of the headers", b"408"),
        ("half of a body", b"408"),
        ("half of a body without a token", b"401"),
        ("half of a body that nobody reads", b"405"),
    ],
)
def test_half_a_request_is_answered_once_and_closed(
    connect: Callable[..., socket.socket], half: str, status: bytes
) -> None:
    answer = received(connect(HALVES[half]))
    assert answer.count(b"HTTP/1.1 ") == bool(status)
    assert answer[9:12] == status


def test_a_request_that_trickles_in_is_closed(connect: Callable[..., socket.socket]) -> None:
    connection = connect(b"GET /healthz HTTP/1.1\r\nHost: localhost\r\n")
    began = time.monotonic()
    with pytest.raises(OSError):
        while time.monotonic() - began < 15:
            connection.sendall(b"X-More: 1\r\n")
            time.sleep(0.1)


def test_six_hundred_half_sent_requests_keep_nobody_out(origin: str, connect: Callable[..., socket.socket]) -> None:
    halves = [
        connect(HALVES[name]) for name in ("a method", "half of the headers", "half of a body") for _ in range(200)
    ]
    assert httpx.get(f"{origin}/healthz", timeout=20).status_code == 200
    for half in halves:
        received(half)
    assert httpx.get(f"{origin}/healthz", timeout=20).status_code == 200


async def echo(scope: Scope, receive: Receive, send: Send) -> None:
    """Answers with the method, the headers and the body of the request; with megabytes at /large."""
    if scope["type"] != "http":
        return
    body, is_more = b"", True
    while is_more:
        message = await receive()
        if message["type"] == "http.disconnect":
            return
        body, is_more = body + message["body"], message["more_body"]
    if scope["path"] == "/large":
        parts = [bytes(1 << 20)] * 100  # more than the buffers of both ends take
    else:
        parts = [b" ".join([scope["method"].encode(), *(b"%b:%b" % header for header in scope["headers"]), body])]
    length = str(sum(map(len, parts))).encode()
    await send({"type": "http.response.start", "status": 200, "headers": [(b"content-length", length)]})
    for place, part in enumerate(parts, 1):
        await send({"type": "http.response.body", "body": part, "more_body": place < len(parts)})


@pytest.fixture(scope="module")
def echoing() -> Iterator[str]:
    with serving(echo, http=Hasty) as origin:
        yield origin


@pytest.fixture
def talk(echoing: str) -> Iterator[Callable[[bytes], socket.socket]]:
    """Opens a connection to the echo, and sends something."""
    with ExitStack() as sockets:

        def talk(sent: bytes) -> socket.socket:
            address = urlsplit(echoing)
            connection = sockets.enter_context(socket.create_connection((address.hostname, address.port), timeout=20))
            connection.sendall(sent)
            return connection

        yield talk


def test_a_client_that_does_not_read_is_cut_off(talk: Callable[[bytes], socket.socket]) -> None:
    connection = talk(b"GET /large HTTP/1.1\r\nHost: a\r\n\r\n")
    deadline = time.monotonic() + 20
    with pytest.raises((ConnectionResetError, BrokenPipeError)):
        while time.monotonic() < deadline:
            connection.send(b"G")
            time.sleep(0.05)


def test_requests_sent_together_are_answered_in_their_order(talk: Callable[[bytes], socket.socket]) -> None:
    requests = [b"POST / HTTP/1.1\r\nHost: a\r\nContent-Length: 2\r\n\r\n%02d" % number for number in range(50)]
    answers = received(talk(b"".join(requests)))
    assert [part[-2:] for part in answers.split(b"HTTP/1.1 200 OK")[1:]] == [b"%02d" % one for one in range(50)]


def test_too_many_requests_sent_together_close_the_connection(talk: Callable[[bytes], socket.socket]) -> None:
    answers = received(talk(b"GET / HTTP/1.1\r\nHost: a\r\n\r\n" * (2 * WAITING_MAX)))
    assert answers.count(b"HTTP/1.1 ") < WAITING_MAX
    assert b"HTTP/1.1 400" not in answers


@pytest.mark.parametrize("line", [b"X-More: 1\r\n", b"X"], ids=["many headers", "one header"])
def test_headers_are_limited_in_size(talk: Callable[[bytes], socket.socket], line: bytes) -> None:
    connection = talk(b"GET / HTTP/1.1\r\nHost: a\r\n")
    part = line * (16_384 // len(line))
    with suppress(OSError):  # it is closed before everything is sent
        for _ in range(4 * HEAD_BYTES_MAX // len(part)):
            connection.sendall(part)
            time.sleep(0.01)
    assert received(connection).startswith(b"HTTP/1.1 431 Request Header Fields Too Large")


def test_headers_that_come_in_one_piece_are_limited_too(talk: Callable[[bytes], socket.socket]) -> None:
    lines = b"X-More: 1\r\n" * (2 * HEAD_BYTES_MAX // 11)
    answer = received(talk(b"GET / HTTP/1.1\r\nHost: a\r\n" + lines + b"\r\n"))
    assert answer[:13] in (b"HTTP/1.1 400 ", b"HTTP/1.1 431 ")  # as the pieces happen to arrive


def test_trailers_are_not_headers(talk: Callable[[bytes], socket.socket]) -> None:
    head = b"POST / HTTP/1.1\r\nHost: a\r\nTransfer-Encoding: chunked\r\n\r\n"
    answer = received(talk(head + b"2\r\nhi\r\n0\r\nX-Forwarded-For: b\r\n\r\n"))
    assert answer.endswith(b"POST host:a transfer-encoding:chunked hi")


def test_endless_trailers_are_cut_off(talk: Callable[[bytes], socket.socket]) -> None:
    connection = talk(b"POST / HTTP/1.1\r\nHost: a\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n")
    with suppress(OSError):
        for _ in range(16):
            connection.sendall(b"X-More: 1\r\n" * 1500)
            time.sleep(0.01)
    assert received(connection).startswith(b"HTTP/1.1 431 ")


def test_what_is_no_http_is_refused(talk: Callable[[bytes], socket.socket]) -> None:
    assert received(talk(b"\x16\x03\x01 hello\r\n\r\n")).startswith(b"HTTP/1.1 400 ")


def test_broken_chunks_are_refused_once(talk: Callable[[bytes], socket.socket]) -> None:
    head = b"POST / HTTP/1.1\r\nHost: a\r\nTransfer-Encoding: chunked\r\n\r\n"
    answer = received(talk(head + b"no size\r\n"))
    assert answer.startswith(b"HTTP/1.1 400 ")
    assert answer.count(b"HTTP/1.1 ") == 1


OFFER = b"Connection: Upgrade, close\r\nUpgrade: h2c\r\n"


@pytest.mark.parametrize("pause_s", [0.0, 0.1])
@pytest.mark.parametrize(
    ("framing", "body"),
    [(b"Content-Length: 2", b"hi"), (b"Transfer-Encoding: chunked", b"2\r\nhi\r\n0\r\n\r\n"), (b"X-No: 1", b"")],
    ids=["length", "chunks", "no body"],
)
def test_an_offer_of_another_protocol_is_ignored(
    talk: Callable[[bytes], socket.socket], framing: bytes, body: bytes, pause_s: float
) -> None:
    first = b"POST / HTTP/1.1\r\nHost: a\r\n" + OFFER.replace(b", close", b"") + framing + b"\r\n\r\n"
    second = b"GET / HTTP/1.1\r\nHost: b\r\n" + OFFER + b"\r\n"
    if pause_s:
        connection = talk(first)
        time.sleep(pause_s)
        connection.sendall(body + second)
    else:
        connection = talk(first + body + second)
    answers = [part.partition(b"\r\n\r\n")[2] for part in received(connection).split(b"HTTP/1.1 200 OK")[1:]]
    assert [answer[:11] for answer in answers] == [b"POST host:a", b"GET host:b "]
    assert answers[0].endswith(b" hi" if body else b" x-no:1 ")


@pytest.mark.parametrize("last", [b"Connection: close\r\n", OFFER], ids=["plain", "offer"])
def test_a_last_request_is_answered_although_more_comes(talk: Callable[[bytes], socket.socket], last: bytes) -> None:
    connection = talk(b"GET / HTTP/1.1\r\nHost: a\r\n" + last + b"\r\nGET / HTTP/1.1\r\nHost: b\r\n\r\n")
    assert received(connection).count(b"HTTP/1.1 200 OK") == 1


def test_a_long_response_is_not_cut_off_by_half_a_request_behind_it(talk: Callable[[bytes], socket.socket]) -> None:
    """It is read slowly, for longer than a request may take to arrive."""
    connection = talk(b"GET /large HTTP/1.1\r\nHost: a\r\n\r\nGET /")
    got, began = 0, time.monotonic()
    while got < 100 << 20:
        part = connection.recv(1 << 20)
        assert part
        got += len(part)
        if time.monotonic() - began < 3 * Hasty.arrival_s:
            time.sleep(0.05)
    assert b"HTTP/1.1 408 " in received(connection)


def test_a_connection_is_kept_for_many_whole_requests(origin: str) -> None:
    with httpx.Client(base_url=origin) as client:
        for _ in range(5):
            assert client.get("/healthz").status_code == 200
            time.sleep(0.3)


def test_the_server_has_these_limits(tmp_path: Path) -> None:
    config = server_config(create_app(Settings(data=tmp_path, workers=0)), Settings())
    assert config.http is TimedProtocol
    assert 5 <= TimedProtocol.arrival_s <= 60
