"""Servers of others, for tests: real HTTP on loopback, answering as a function says."""

import asyncio
import json
import socket
import ssl
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from ipaddress import ip_address
from typing import Any

from grader.platforms.sending.outgoing import Address

HERE = "127.0.0.1"


@dataclass(frozen=True)
class Asked:
    """A request as it came in; names of headers are in lower case."""

    method: str
    path: str
    headers: Mapping[str, str]
    body: bytes

    def json(self) -> Any:
        return json.loads(self.body)


@dataclass(frozen=True)
class Answer:
    """What is answered; `drops` closes the connection instead."""

    status: int = 200
    body: bytes = b""
    headers: Mapping[str, str] = field(default_factory=dict)
    drops: bool = False

    @classmethod
    def of(cls, value: Any, status: int = 200, **headers: str) -> "Answer":
        return cls(status, json.dumps(value).encode(), {"Content-Type": "application/json", **headers})


Respond = Callable[[Asked], Answer]


@contextmanager
def receiving(respond: Respond, tls: ssl.SSLContext | None = None) -> Iterator[int]:
    """The port on which the answers come."""

    class Handler(BaseHTTPRequestHandler):
        def handle_one_request(self) -> None:
            self.close_connection = True
            self.raw_requestline = self.rfile.readline(65537)
            if not self.raw_requestline or not self.parse_request():
                return
            length = int(self.headers.get("content-length", 0))
            headers = {name.lower(): value for name, value in self.headers.items()}
            answer = respond(Asked(self.command, self.path, headers, self.rfile.read(length)))
            if answer.drops:
                return
            self.send_response(answer.status)
            for name, value in answer.headers.items():
                self.send_header(name, value)
            self.send_header("Content-Length", str(len(answer.body)))
            self.end_headers()
            with suppress(BrokenPipeError, ConnectionResetError):
                self.wfile.write(answer.body)

        def log_message(self, *_: Any) -> None:
            """Says nothing."""

    class Server(ThreadingHTTPServer):
        daemon_threads = True
        request_queue_size = 64

        def handle_error(self, *_: Any) -> None:
            """A client that does not trust the certificate, or that was killed."""

        def get_request(self) -> tuple[socket.socket, Any]:
            taken, address = super().get_request()
            return (taken if tls is None else tls.wrap_socket(taken, server_side=True)), address

    server = Server((HERE, 0), Handler)
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02}, daemon=True)
    thread.start()
    try:
        yield server.server_address[1]
    finally:
        server.shutdown()
        server.server_close()
        thread.join()


def resolving(*addresses: str) -> Callable[[str, int], "asyncio.Future[list[Address]]"]:
    """A resolver that has these addresses for every name."""

    def resolve(_host: str, _port: int) -> "asyncio.Future[list[Address]]":
        future: asyncio.Future[list[Address]] = asyncio.get_running_loop().create_future()
        future.set_result([ip_address(address) for address in addresses])
        return future

    return resolve
