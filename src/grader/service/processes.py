"""`grader serve`: one server process, or several that share one listening socket, with a worker beside them. With
several, the process that was started serves nothing itself: it passes signals on, and starts a process again that
ended. None outlives it, since each reads a pipe of which it alone holds the other end. It imports little."""

import json
import os
import pickle
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from errno import EROFS
from functools import partial
from typing import TYPE_CHECKING, Any

import structlog

from grader.errors import ContentError
from grader.grading.processes import Graders
from grader.logs import is_json, log_to_stderr
from grader.metrics import FOLDER, locked, shared_folder
from grader.settings import Settings

if TYPE_CHECKING:
    from fastapi import FastAPI

MAIN = "from grader.commands.main import main; from grader.service.processes import run_part; main(run_part)"

BACKLOG = 2048
"""Connections that may wait to be accepted; uvicorn's own default."""

PAUSE_S, PAUSE_S_MAX = 0.5, 30.0
"""Pause before a process is started again [s], and after several that were never ready."""

FAULT = 3

BLOCK_BYTES = 4096

END_S = 30.0
"""Longest end of a process; then it is killed [s]."""

log = structlog.get_logger()


@dataclass(frozen=True)
class Part:
    """What one process gets: its settings, and the descriptors that it inherits. A worker has no `listener`."""

    settings: Settings
    listener: int | None
    ready: int


class Child:
    """A server or worker process, which is started again whenever it ends until `stopping` is set."""

    def __init__(self, settings: Settings, listener: int | None, *, metrics: str, stopping: threading.Event) -> None:
        self._settings, self._listener = settings, listener
        self._environment = {**os.environ, FOLDER: metrics}
        self._stopping = stopping
        self._process: subprocess.Popen[bytes] | None = None
        self._is_ready = self._reload_due = False
        self.report: Mapping[str, Any] = {}
        """What it reported when it was ready: a worker describes its jail."""

    @property
    def exit_status(self) -> int:
        """The exit status of the process; a fault if a signal ended it."""
        status = None if self._process is None else self._process.wait()
        return status if status is not None and status > 0 else FAULT

    def start(self) -> bool:
        """Starts the process. Returns whether it became ready; False also once everything ends."""
        if self._stopping.is_set():
            return False
        inherited, pipe = [] if self._listener is None else [self._listener], os.pipe()
        try:
            self._process = process = subprocess.Popen(  # noqa: S603  our own command
                [sys.executable, "-P", "-c", MAIN],
                env=self._environment, stdin=subprocess.PIPE, pass_fds=[*inherited, pipe[1]],
            )  # fmt: skip
        finally:
            os.close(pipe[1])
        with os.fdopen(pipe[0]) as ready:
            assert process.stdin is not None
            part = Part(self._settings, self._listener, pipe[1])
            try:
                process.stdin.write(pickle.dumps(part))
                process.stdin.flush()
            except BrokenPipeError:  # it ended at once
                return False
            if self._stopping.is_set():  # its signal came before there was a process
                process.terminate()
            report = ready.read()
        self.report, self._is_ready = json.loads(report) if report else {}, bool(report)
        if self._reload_due:
            self.reload()
        return self._is_ready

    def keep_running(self) -> None:
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
    log_to_stderr(as_json=is_json(settings.log_format))
    require_free_port(settings.host, settings.port)
    log.info("starting", host=settings.host, port=settings.port, processes=settings.processes)
    if settings.processes == 1:
        serve_alone(settings)
        log.info("ended")
        return
    stopping = threading.Event()
    with ExitStack() as stack:
        listener = stack.enter_context(open_listener(settings.host, settings.port))
        bound = settings.model_copy(update={"port": listener.getsockname()[1]})
        make = partial(Child, metrics=stack.enter_context(shared_folder()), stopping=stopping)
        servers = [make(bound.model_copy(update={"workers": 0}), listener.fileno()) for _ in range(settings.processes)]
        children = [*servers, *([make(bound, None)] if settings.workers else [])]
        catch_signals(children, stopping)
        try:
            status = supervise(children, stopping, bound)
        finally:
            stopping.set()
            listener.close()  # connections that are not accepted yet are refused
            with ThreadPoolExecutor(len(children)) as pool:
                list(pool.map(Child.end, children))
    log.info("ended", status=status)
    sys.exit(status)


def serve_alone(settings: Settings) -> None:
    """Serves in this process. The jails start while the app is imported and the content is checked."""
    graders = Graders(settings.workers, allow_t2=settings.allow_t2)
    with hold_database(settings), open_listener(settings.host, settings.port) as listener:
        bound = settings.model_copy(update={"port": listener.getsockname()[1]})
        try:
            graders.begin()
            from grader.service.serving import run_app

            run_app(bound, listener, partial(tell_that_ready, bound), graders)
        except ContentError:
            print("Not started. What must be mended first:", file=sys.stderr)
            raise
        finally:
            graders.close()


@contextmanager
def hold_database(settings: Settings) -> Iterator[None]:
    """Holds the folder of a SQLite database until this process ends, however it does: another server would take the
    jobs at which this one works. Exits with one line where another has it, or where there can be no such folder."""
    folder = settings.sqlite_folder
    with ExitStack() as held:
        try:
            if folder is not None:
                folder.mkdir(parents=True, exist_ok=True)
                if not os.access(folder, os.W_OK):
                    raise OSError(EROFS, "it cannot be written")
                held.enter_context(locked(folder))
        except OSError as error:
            is_taken = isinstance(error, BlockingIOError)
            why = "another server works on it" if is_taken else error.strerror or str(error)
            cure = "stop that one first, or name" if is_taken else "name"
            print(
                f"There can be no database in {folder} ({why}): {cure} another folder with --data or GRADER_DATA.",
                file=sys.stderr,
            )
            sys.exit(FAULT)
        yield


def tell_that_ready(settings: Settings, app: "FastAPI") -> None:
    """Prints the addresses of a service that is ready, and how its scripts are jailed."""
    from grader.gate.services import get_services
    from grader.service.accounts import tell_addresses

    checks = get_services(app).readiness.checks
    tell_addresses(settings, checks["jail"]() if "jail" in checks else {})


def catch_signals(children: Sequence[Child], stopping: threading.Event) -> None:
    """Passes signals on: the end to all processes, SIGHUP to the servers; workers ignore it."""

    def end(_number: int, _frame: object) -> None:
        stopping.set()
        for child in children:
            child.terminate()

    def reload(_number: int, _frame: object) -> None:
        for child in children:
            child.reload()

    signal.signal(signal.SIGTERM, end)
    signal.signal(signal.SIGINT, end)
    signal.signal(signal.SIGHUP, reload)


def supervise(children: Sequence[Child], stopping: threading.Event, settings: Settings) -> int:
    """Starts the processes and keeps them until `stopping`. Returns 0, or the status of one that cannot start. The
    first starts alone: it moves the tables, and tells the faults of content and settings once."""
    first, *others = children
    with ThreadPoolExecutor(len(children)) as pool:
        alive = {first: first.start()}
        if alive[first]:
            alive |= zip(others, pool.map(Child.start, others), strict=True)
    if stopping.is_set():
        return 0
    for child, is_ready in alive.items():
        if not is_ready:
            print("Not started: mend what is named above, then start again.", file=sys.stderr)
            return child.exit_status
    from grader.service.accounts import tell_addresses

    tell_addresses(settings, children[-1].report)
    keepers = [threading.Thread(target=child.keep_running) for child in children]
    for keeper in keepers:
        keeper.start()
    for keeper in keepers:
        keeper.join()
    return 0


def require_free_port(host: str, port: int) -> None:
    """Exits with one line where the port cannot be opened, before anything is started."""
    try:
        open_listener(host, port).close()
    except OSError as error:
        reason = error.strerror or str(error)
        print(f"Port {port} of {host} cannot be opened ({reason}): choose another with --port.", file=sys.stderr)
        sys.exit(FAULT)


def open_listener(host: str, port: int) -> socket.socket:
    """Opens a listening socket. Raises OSError."""
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
    ready = partial(report_ready, part.ready)
    if part.listener is None:
        from grader.service.deliveries import build_deliveries
        from grader.service.worker import run_worker

        run_worker(part.settings, build_deliveries, ready)
        return
    from grader.service.serving import run_app

    run_app(part.settings, socket.socket(fileno=part.listener), lambda _: ready({}))


def report_ready(descriptor: int, report: Mapping[str, Any]) -> None:
    """Reports that this process is ready."""
    with os.fdopen(descriptor, "w") as ready:
        json.dump(dict(report), ready)


def end_with_parent() -> None:
    """Ends this process, as a signal would, once the process that started it has ended."""
    while os.read(sys.stdin.fileno(), BLOCK_BYTES):  # a buffered reader's lock would be held when the interpreter ends
        pass
    backstop = threading.Timer(END_S, os._exit, (FAULT,))
    backstop.daemon = True
    backstop.start()
    os.kill(os.getpid(), signal.SIGTERM)
