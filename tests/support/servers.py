"""A real server for tests: the app under uvicorn on a free port, in a thread."""

import socket
import ssl
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Literal

import uvicorn
from starlette.types import ASGIApp

from grader.service.serving import GatheringProtocol

START_S = 120.0

PLAIN = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
"""For clients of plain HTTP: it trusts no certificate, since reading those of the system takes 20 ms a client."""


@contextmanager
def serving(
    app: ASGIApp, port: int = 0, certificate: Path | None = None, loop: Literal["auto", "asyncio"] = "auto"
) -> Iterator[str]:
    """The origin under which the app answers; a `certificate` with its key makes it https."""
    # asyncio switches Nagle's algorithm off only for sockets that name TCP: with it every answer would take 40 ms.
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    listener.bind(("127.0.0.1", port))
    listener.listen(128)
    config = uvicorn.Config(
        app, http=GatheringProtocol, ws="none", log_level="warning", access_log=False, proxy_headers=False,
        timeout_graceful_shutdown=2, ssl_certfile=certificate, loop=loop,
    )  # fmt: skip
    server = uvicorn.Server(config)
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]})
    thread.start()
    deadline = time.monotonic() + START_S
    while not server.started and thread.is_alive():
        assert time.monotonic() < deadline, "the server does not start"
        time.sleep(0.002)
    assert server.started, "the server ended while it started"
    try:
        yield f"{'http' if certificate is None else 'https'}://127.0.0.1:{listener.getsockname()[1]}"
    finally:
        server.should_exit = True
        thread.join()
        listener.close()
