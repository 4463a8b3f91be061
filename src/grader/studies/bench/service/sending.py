"""Clients that hand in answers over HTTP, many at once in one thread, and cost the machine as little as possible."""

import json
import selectors
import socket
import time
from collections.abc import Iterator, Sequence
from typing import Any

PATH = "/api/v1/submissions"
TIMEOUT_S = 60.0


class Client:
    """A connection that sends one request after the other, each once the answer before it is there."""

    def __init__(self, port: int, requests: Iterator[bytes]) -> None:
        self.port, self.requests = port, requests
        self.connect()

    def connect(self) -> None:
        """Opens a new connection: a server closes those that are idle."""
        self.socket = socket.create_connection(("127.0.0.1", self.port), timeout=TIMEOUT_S)
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def close(self) -> None:
        """Closes the connection."""
        self.socket.close()

    def send(self) -> None:
        """Sends the next request."""
        request, self.got = next(self.requests), b""
        self.began = time.perf_counter()
        self.socket.sendall(request)

    def receive(self) -> float | None:
        """Receives a part of the response. Returns the time since the request once the whole is there [s], else None.
        Raises RuntimeError for anything but 201."""
        part = self.socket.recv(65536)
        if not part:
            raise RuntimeError("the server closed the connection")
        self.got += part
        end = self.got.find(b"\r\n\r\n")
        if end < 0:
            return None
        length = int(self.got[:end].lower().split(b"content-length:")[1].split(b"\r\n")[0])
        if len(self.got) < end + 4 + length:
            return None
        if not self.got.startswith(b"HTTP/1.1 201"):
            raise RuntimeError(f"the server answered {self.got[:500]!r}")
        return time.perf_counter() - self.began

    def answer(self) -> float:
        """Sends the next request. Returns the time until the whole response is there [s]."""
        self.send()
        while (time_s := self.receive()) is None:
            pass
        return time_s


def build_request(token: str, port: int, body: Any) -> bytes:
    """Returns the request that hands in this body with this token."""
    text = json.dumps(body).encode()
    head = f"POST {PATH} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nAuthorization: Bearer {token}\r\n"
    return f"{head}Content-Type: application/json\r\nContent-Length: {len(text)}\r\n\r\n".encode() + text


def send_together(clients: Sequence[Client], seconds: float, least: int = 1) -> list[float]:
    """Sends from every client at once, on new connections, for so long, and at least so many requests from each.
    Returns the times of all [s]."""
    times: list[float] = []
    sent = dict.fromkeys(clients, 1)
    with selectors.DefaultSelector() as selector:
        for client in clients:
            client.close()
            client.connect()
            selector.register(client.socket, selectors.EVENT_READ, client)
        until, busy = time.perf_counter() + seconds, len(clients)
        for client in clients:
            client.send()
        while busy:
            ready = selector.select(TIMEOUT_S)
            if not ready:
                raise RuntimeError(f"the server has not answered for {TIMEOUT_S:.0f} s")
            for key, _ in ready:
                client = key.data
                time_s = client.receive()
                if time_s is None:
                    continue
                times.append(time_s)
                if sent[client] < least or time.perf_counter() < until:
                    sent[client] += 1
                    client.send()
                else:
                    busy -= 1
    return times
