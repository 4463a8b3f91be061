"""Connections that send or read too slowly are closed; honest ones are served meanwhile. With real sockets."""

import socket
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import httpx
import pytest

from grader.api.connections import TimedProtocol
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


@pytest.mark.slow
def test_a_client_that_does_not_read_is_cut_off(connect: Callable[..., socket.socket]) -> None:
    connection = connect(b"")
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    # The responses, 9 KB each, must not fit into the buffers of both ends, which may grow to some megabytes.
    connection.sendall(b"GET /static/style.css HTTP/1.1\r\nHost: localhost\r\n\r\n" * 2000)
    deadline = time.monotonic() + 100
    with pytest.raises((ConnectionResetError, BrokenPipeError)):
        while time.monotonic() < deadline:
            connection.send(b"G")
            time.sleep(0.05)


def test_a_connection_is_kept_for_many_whole_requests(origin: str) -> None:
    with httpx.Client(base_url=origin) as client:
        for _ in range(5):
            assert client.get("/healthz").status_code == 200
            time.sleep(0.3)


def test_the_server_has_these_limits(tmp_path: Path) -> None:
    config = server_config(create_app(Settings(data=tmp_path, workers=0)), Settings())
    assert config.http is TimedProtocol
    assert 5 <= TimedProtocol.arrival_s <= 60
