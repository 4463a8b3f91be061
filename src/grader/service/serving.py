"""Serves with uvicorn from the first moment: while the service is imported and built `/healthz` answers, `/readyz` says
that it starts, and every other request waits. It imports little itself."""

import asyncio
import signal
import socket
import sys
import threading
from collections.abc import Callable
from concurrent.futures import Future
from http import HTTPStatus
from typing import TYPE_CHECKING, Any

import uvicorn
from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol

if TYPE_CHECKING:
    from fastapi import FastAPI

    from grader.grading.processes import Graders
    from grader.settings import Settings

SHUTDOWN_S = 5
"""How long a shutdown waits for open event streams [s]."""

SWITCH_S = 0.0005
"""How long a thread keeps the interpreter while another waits for it [s]: the event loop is always busy, and the writer
waits after every answer of the database. Python's own 5 ms would be most of the time that a batch takes."""

GATHERED_BYTES_MAX = 64 * 1024
"""Bytes of a response that are sent together at most."""

ALIVE = b'{"status":"ok"}'
"""What `/healthz` says, also once the service has taken over."""

STARTING = (
    b'{"title":"Service Unavailable","status":503,"detail":"It starts: the content is loaded and its keys are checked, '
    b'which takes minutes where none of them has been checked before."}'
)

NOT_STARTED = b'{"title":"Service Unavailable","status":503,"detail":"The service could not start; its log says why."}'


class StartingApp:
    """The ASGI app of a server whose service is being built, in a thread, and then that service.

    `opened` is the service once its own lifespan has begun, or the error that ended the start.
    """

    def __init__(self, build: Callable[[], "FastAPI"]) -> None:
        self.build = build
        self.opened: Future[FastAPI] = Future()
        self.opened.set_running_or_notify_cancel()  # a request that is given up does not cancel it
        self._ending = asyncio.Event()

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        """Handles the lifespan or a request, as ASGI says."""
        if self.opened.done():
            await self.opened.result()(scope, receive, send)
        elif scope["type"] == "lifespan":
            await self._live(receive, send)
        elif scope["path"] == "/healthz" and scope["method"] == "GET":
            await answer(send, 200, ALIVE)
        elif scope["path"] == "/readyz":
            await answer(send, 503, STARTING, (b"retry-after", b"1"))
        else:
            try:
                app = await asyncio.wrap_future(self.opened)
            except Exception:  # `run_app` raises it
                await answer(send, 503, NOT_STARTED)
            else:
                await app(scope, receive, send)

    async def _live(self, receive: Any, send: Any) -> None:
        """Starts at once; the service lives beside it."""
        assert (await receive())["type"] == "lifespan.startup"
        service = asyncio.create_task(self._serve())
        await send({"type": "lifespan.startup.complete"})
        assert (await receive())["type"] == "lifespan.shutdown"
        self._ending.set()
        await service
        await send({"type": "lifespan.shutdown.complete"})

    async def _serve(self) -> None:
        """Builds the service, and runs its lifespan until the end."""
        try:
            app = await asyncio.to_thread(self.build)
            if self._ending.is_set():
                raise InterruptedError("The server was ended while it started.")
            async with app.router.lifespan_context(app):
                self.opened.set_result(app)
                await self._ending.wait()
        except BaseException as error:
            if self.opened.done():
                raise
            self.opened.set_exception(error)


async def answer(send: Any, status: int, document: bytes, *headers: tuple[bytes, bytes]) -> None:
    """Answers a request with a JSON document."""
    sort = b"application/json" if status < HTTPStatus.BAD_REQUEST else b"application/problem+json"
    headers = (*headers, (b"content-type", sort), (b"content-length", b"%d" % len(document)))
    await send({"type": "http.response.start", "status": status, "headers": list(headers)})
    await send({"type": "http.response.body", "body": document})


class GatheringProtocol(HttpToolsProtocol):
    """Speaks HTTP as uvicorn does, and sends a response whole: uvicorn writes its head and its body each by itself, and
    both calls of the system together took a sixth of the CPU time of an answer."""

    def connection_made(self, transport: Any) -> None:
        """Takes over a connection."""
        super().connection_made(GatheredWrites(transport))  # type: ignore[arg-type]


class GatheredWrites:
    """A transport that sends together what is written in one step of the event loop. It does so behind everything that
    was to be done after the step when the last part came: a client finds its request in the log."""

    def __init__(self, transport: asyncio.Transport) -> None:
        self._transport = transport
        self._parts: list[bytes] = []
        self._bytes = self._due = 0

    def write(self, data: bytes) -> None:
        """Keeps a part until the step is over, unless it is long: then the transport says when it has enough."""
        asyncio.get_running_loop().call_soon(self._send_last)
        self._parts.append(data)
        self._bytes += len(data)
        self._due += 1
        if self._bytes >= GATHERED_BYTES_MAX:
            self._send()

    def close(self) -> None:
        """Closes the connection once everything is sent."""
        self._send()
        self._transport.close()

    def _send_last(self) -> None:
        self._due -= 1
        if not self._due:
            self._send()

    def _send(self) -> None:
        parts, self._parts, self._bytes = self._parts, [], 0
        if parts:
            self._transport.write(b"".join(parts))

    def __getattr__(self, name: str) -> Any:
        """Everything else is the transport's own."""
        return getattr(self._transport, name)


def server_config(app: StartingApp) -> uvicorn.Config:
    """Returns how uvicorn serves the app. It knows no proxies: `create_app` adds those of the settings."""
    return uvicorn.Config(
        app, lifespan="on", http=GatheringProtocol, ws="none", loop="uvloop", log_config=None, log_level="warning",
        access_log=False, proxy_headers=False, server_header=False, timeout_graceful_shutdown=SHUTDOWN_S,
    )  # fmt: skip


def run_app(
    settings: "Settings",
    listener: socket.socket,
    ready: Callable[["FastAPI"], None],
    graders: "Graders | None" = None,
) -> None:
    """Serves on this listener until a signal ends it; SIGHUP loads the content again. Calls `ready` with the app as
    soon as pages can be opened. `graders` may have begun. Raises what building the service does."""

    def build() -> "FastAPI":
        from grader.service.app import create_app

        return create_app(settings, graders, lambda: server.should_exit)

    def finish_start(opened: "Future[FastAPI]") -> None:
        if opened.exception() is not None:
            server.should_exit = True
        else:
            ready(opened.result())

    def reload() -> None:
        from grader.gate.services import get_services

        get_services(app.opened.result()).content.reload_or_log()

    sys.setswitchinterval(SWITCH_S)
    app = StartingApp(build)
    app.opened.add_done_callback(finish_start)
    server = uvicorn.Server(server_config(app))
    signal.signal(signal.SIGHUP, lambda *_: threading.Thread(target=reload).start())
    server.run([listener])
    from grader.store.engine.unusable import naming  # the service has imported it

    with naming(settings.database):
        app.opened.result()
