"""`grader serve`: one server process, or several that share one listening socket, with a worker beside them.

With several, the process that was started serves nothing itself: it passes signals on, and starts a process again that
ended. None outlives it, since each reads a pipe of which it alone holds the other end. It imports little.
"""

import json
import os
import pickle
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from typing import Any

import structlog

from grader.accounts import tell_addresses
from grader.api.rate import SharedBuckets
from grader.logs import is_json, log_to_stderr
from grader.metrics import FOLDER, shared_folder
from grader.settings import Settings

MAIN = "from grader.cli import main; from grader.serving import run_part; main(run_part)"

BACKLOG = 2048
"""Connections that may wait to be accepted; uvicorn's own default."""

PAUSE_S, PAUSE_S_MAX = 0.5, 30.0
"""Pause before a process is started again [s], and after several that were never ready."""

FAULT = 3

END_S = 30.0
"""Longest end of a process; then it is killed [s]."""

log = structlog.get_logger()


@dataclass(frozen=True)
class Part:
    """What one process is told: its settings, and the descriptors that it inherits. A worker has no `listener`."""

    settings: Settings
    listener: int | None
    buckets: int
    ready: int


class Kept:
    """A process that is started again whenever it ends, until `stopping` is set."""

    def __init__(
        self, settings: Settings, listener: int | None, *, buckets: int, metrics: str, stopping: threading.Event
    ) -> None:
        self._settings, self._listener, self._buckets = settings, listener, buckets
        self._environment = {**os.environ, FOLDER: metrics}
        self._stopping = stopping
        self._process: subprocess.Popen[bytes] | None = None
        self._is_ready = self._reload_due = False
        self.told: Mapping[str, Any] = {}
        """What it said when it was ready: a worker describes its jail."""

    @property
    def exit_status(self) -> int:
        """With what the process ended; a fault if a signal ended it."""
        status = None if self._process is None else self._process.wait()
        return status if status is not None and status > 0 else FAULT

    def start(self) -> bool:
        """Starts the process. Returns whether it became ready; False also once everything ends."""
        if self._stopping.is_set():
            return False
        theirs, ours = [one for one in (self._listener, self._buckets) if one is not None], os.pipe()
        try:
            self._process = process = subprocess.Popen(  # noqa: S603  our own command
                [sys.executable, "-P", "-c", MAIN],
                env=self._environment, stdin=subprocess.PIPE, pass_fds=[*theirs, ours[1]],
            )  # fmt: skip
        finally:
            os.close(ours[1])
        with os.fdopen(ours[0]) as ready:
            assert process.stdin is not None
            part = Part(self._settings, self._listener, self._buckets, ours[1])
            try:
                process.stdin.write(pickle.dumps(part))
                process.stdin.flush()
            except BrokenPipeError:  # it ended at once
                return False
            if self._stopping.is_set():  # its signal came before there was a process
                process.terminate()
            said = ready.read()
        self.told, self._is_ready = json.loads(said) if said else {}, bool(said)
        if self._reload_due:
            self.reload()
        return self._is_ready

    def keep(self) -> None:
        """Waits for the end of the process, and starts it again."""
        pause_s = PAUSE_S
        while True:
            assert self._process is not None
            status = self._process.wait()
            if self._stopping.is_set():
                return
            self._is_ready = False
            role = "worker" if self._listener is None else "server"
            log.error("a process ended and is started again", role=role, pid=self._process.pid, status=status)
            self._stopping.wait(pause_s)
            pause_s = PAUSE_S if self.start() else min(2 * pause_s, PAUSE_S_MAX)

    def reload(self) -> None:
        """Makes a server load its content again; one that starts does so when it is ready, as SIGHUP would end it."""
        self._reload_due = True
        if self._is_ready and self._process is not None:
            self._reload_due = False
            self._process.send_signal(signal.SIGHUP)

    def terminate(self) -> None:
        """Begins to end the process."""
        if self._process is not None:
            self._process.terminate()

    def end(self) -> None:
        """Ends the process, and waits for it."""
        if self._process is None:
            return
        self._process.terminate()
        try:
            self._process.wait(END_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


def serve(settings: Settings) -> None:
    """Serves until a signal ends it; SIGHUP loads the content again. Exits with another status if it cannot start."""
    if settings.processes == 1:
        from grader.app import run_server

        run_server(settings)
        return
    log_to_stderr(as_json=is_json(settings.log_format))
    stopping = threading.Event()
    with ExitStack() as stack:
        listener = stack.enter_context(listening(settings.host, settings.port))
        bound = settings.model_copy(update={"port": listener.getsockname()[1]})
        buckets, metrics = SharedBuckets.create(), stack.enter_context(shared_folder())
        stack.callback(os.close, buckets)
        make = partial(Kept, buckets=buckets, metrics=metrics, stopping=stopping)
        servers = [make(bound.model_copy(update={"workers": 0}), listener.fileno()) for _ in range(settings.processes)]
        kept = [*servers, *([make(bound, None)] if settings.workers else [])]
        catch_signals(kept, stopping)
        try:
            status = supervise(kept, stopping, bound)
        finally:
            stopping.set()
            listener.close()  # who is not accepted yet is refused, instead of waiting for nobody
            with ThreadPoolExecutor(len(kept)) as pool:
                list(pool.map(Kept.end, kept))
    sys.exit(status)


def catch_signals(kept: Sequence[Kept], stopping: threading.Event) -> None:
    """Passes signals on: the end to all processes, SIGHUP to the servers; workers ignore it."""

    def end(_number: int, _frame: object) -> None:
        stopping.set()
        for one in kept:
            one.terminate()

    def reload(_number: int, _frame: object) -> None:
        for one in kept:
            one.reload()

    signal.signal(signal.SIGTERM, end)
    signal.signal(signal.SIGINT, end)
    signal.signal(signal.SIGHUP, reload)


def supervise(kept: Sequence[Kept], stopping: threading.Event, settings: Settings) -> int:
    """Starts the processes and keeps them until `stopping`. Returns 0, or the status of one that cannot start.

    The first starts alone: it moves the tables, and tells the faults of content and settings once.
    """
    first, *others = kept
    with ThreadPoolExecutor(len(kept)) as pool:
        alive = {first: first.start()}
        if alive[first]:
            alive |= zip(others, pool.map(Kept.start, others), strict=True)
    if stopping.is_set():
        return 0
    for one, is_ready in alive.items():
        if not is_ready:
            return one.exit_status
    tell_addresses(settings, kept[-1].told)
    keepers = [threading.Thread(target=one.keep) for one in kept]
    for keeper in keepers:
        keeper.start()
    for keeper in keepers:
        keeper.join()
    return 0


def listening(host: str, port: int) -> socket.socket:
    """A socket that listens. Raises OSError."""
    family, _, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
    # asyncio switches Nagle's algorithm off only for sockets that name TCP: with it every answer would take 40 ms.
    listener = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(address)
        listener.listen(BACKLOG)
    except OSError:
        listener.close()
        raise
    return listener


def run_part() -> None:
    """Runs one process, as its standard input says, until that ends."""
    part: Part = pickle.load(sys.stdin.buffer)  # noqa: S301  our own process wrote it
    threading.Thread(target=end_with_parent, daemon=True).start()
    ready = partial(tell_ready, part.ready)
    if part.listener is None:
        from grader.deliveries import deliveries_of
        from grader.worker import run_worker

        run_worker(part.settings, deliveries_of, ready)
        return
    from grader.app import run_app

    listener, buckets = socket.socket(fileno=part.listener), SharedBuckets(part.buckets)
    run_app(part.settings, lambda _port, _app: ready({}), listener, buckets)


def tell_ready(descriptor: int, said: Mapping[str, Any]) -> None:
    """Says that this process is ready."""
    with os.fdopen(descriptor, "w") as ready:
        json.dump(dict(said), ready)


def end_with_parent() -> None:
    """Ends this process, as a signal would, once the process that started it has ended."""
    sys.stdin.buffer.read()
    backstop = threading.Timer(END_S, os._exit, (FAULT,))
    backstop.daemon = True
    backstop.start()
    os.kill(os.getpid(), signal.SIGTERM)
