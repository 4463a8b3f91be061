"""A real server for tests: the app under uvicorn on a free port, in a thread."""

import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

import uvicorn
from fastapi import FastAPI

from grader.api.connections import TimedProtocol

START_S = 120.0


@contextmanager
def serving(app: FastAPI, http: type[TimedProtocol] = TimedProtocol) -> Iterator[str]:
    """The origin under which the app answers."""
    listener = socket.create_server(("127.0.0.1", 0))
    config = uvicorn.Config(
        app, http=http, ws="none", log_level="warning", access_log=False, proxy_headers=False,
        timeout_graceful_shutdown=2,
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
        yield f"http://127.0.0.1:{listener.getsockname()[1]}"
    finally:
        server.should_exit = True
        thread.join()
        listener.close()
