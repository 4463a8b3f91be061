"""The handles of grading processes: each process has an interpreter and a jail of its own, so that grading uses every
core. It takes the content and submissions over a socket, and returns verdicts; `process_main` is what runs in it. This
module imports little: a server starts the processes first, and imports the rest meanwhile."""

import os
import queue
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection
from pathlib import Path
from tempfile import TemporaryDirectory
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

import structlog

from grader.domain.progress import TrialProgress, ignore_progress
from grader.errors import JailFault
from grader.logs import logs_json
from grader.metrics import GRADERS_BROKEN

if TYPE_CHECKING:
    from grader.domain.verdict import Verdict
    from grader.exercises import Tell
    from grader.library import Library

START_S = 180.0
"""Longest start of a process with its jail and self-test [s]."""
VERDICT_S = 900.0
"""Longest wait for a verdict, far above every limit of a script; then the process is ended and started anew [s]."""
PROGRESS_S = 0.5
"""Pause between two reports of how far a script is: a quick script makes none [s]."""


END_S = 10.0
"""Longest end of a process; then it is killed [s]."""


MAIN = "import gc, os; gc.disable(); os.read(0, 1); from grader.grading.process_main import main; main()"
"""The process waits for a byte before it begins, and looks for no garbage until it is ready. With `-m` the module would
be loaded twice, and what it pickles would be of another class than here."""

log = structlog.get_logger()


@dataclass(frozen=True)
class ScriptJob:
    """A submission as a grading process takes it; `answer` is the stored answer, parsed. `name` is for `stop`."""

    quiz: str
    question: str
    answer: Any
    seed: int | None
    name: str = ""


@dataclass(frozen=True)
class Stop:
    """Ends the script of this name, if it still runs."""

    name: str


@dataclass(frozen=True)
class ScriptProgress:
    """How far the script is: at a case, counted from 1, and in a trial that says so."""

    case: int
    cases: int
    within: TrialProgress | None = None


class GradingProcess:
    """The handle of one process, which does nothing until `begin`. One thread at a time may use it, and any may `stop`
    its script."""

    def __init__(self, *, allow_t2: bool) -> None:
        # A script reads the models of the content that it is graded with, whatever the content folder holds now.
        self._models = TemporaryDirectory(prefix="grader-models-")
        Path(self._models.name).chmod(0o755)
        ours, theirs = socket.socketpair()
        with theirs:
            command = [sys.executable, "-P", "-c", MAIN, str(theirs.fileno()), self._models.name]
            command += ["--allow-t2"] * allow_t2 + ["--json-log"] * logs_json()
            self._process = subprocess.Popen(  # noqa: S603  our own command
                command, stdin=subprocess.PIPE, pass_fds=[theirs.fileno()]
            )
        self._connection: Connection[Any, Any] = Connection(ours.detach())
        self._library: Library | None = None
        self._sending, self._running = threading.Lock(), ""
        self.jail: Mapping[str, Any] = {}

    @property
    def pid(self) -> int:
        """The id of the process."""
        return self._process.pid

    def begin(self) -> None:
        """Lets the process start; once more is no harm."""
        assert self._process.stdin is not None
        with suppress(OSError, ValueError):  # it has ended, and its caller gets an error
            os.write(self._process.stdin.fileno(), b"\n")

    def wait_until_ready(self) -> None:
        """Waits for the jail unless it is ready. Raises JailRefused if this machine cannot hold it, JailFault if the
        process ends."""
        if not self.jail:
            self.begin()
            self.jail = self._receive(START_S)

    def judge(self, library: "Library", script: ScriptJob, tell: "Tell" = ignore_progress) -> "Verdict":
        """Judges a script against this content; `tell` hears how far it is, every PROGRESS_S at most. Raises
        ScriptStopped, and JailFault if the process ends or breaks, and ends it then."""
        self.wait_until_ready()
        try:
            with self._sending:
                if library is not self._library:
                    write_models(library, Path(self._models.name))
                    self._connection.send(make_portable(library))
                    self._library = library
                self._connection.send(script)
                self._running = script.name
            verdict: Verdict = self._receive(VERDICT_S, tell)
        except OSError as error:
            raise self._broken(str(error)) from error
        finally:
            self._running = ""
        return verdict

    def stop(self, name: str) -> None:
        """Has the script of this name end, if this process runs it; a verdict that is on its way stays."""
        with self._sending, suppress(OSError):
            if name == self._running:
                self._connection.send(Stop(name))

    @property
    def alive(self) -> bool:
        """Whether the process runs."""
        return self._process.poll() is None

    def close(self) -> None:
        """Ends the process and its jail, and waits for it."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        try:
            self._process.wait(END_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._connection.close()
        self._models.cleanup()

    def _receive(self, patience_s: float, tell: "Tell" = ignore_progress) -> Any:
        """Returns the answer; hands on the newest progress on the way, and only that."""
        deadline = time.monotonic() + patience_s
        due, newest = time.monotonic() + PROGRESS_S, None
        try:
            while (now := time.monotonic()) < deadline:
                if newest and now >= due:
                    tell(newest.case, newest.cases, newest.within)
                    due, newest = now + PROGRESS_S, None
                if self._connection.poll(min(due if newest else deadline, deadline) - now):
                    reply = self._connection.recv()
                    if isinstance(reply, Exception):
                        raise reply
                    if not isinstance(reply, ScriptProgress):
                        return reply
                    newest = reply
        except (EOFError, OSError) as error:
            raise self._broken(str(error) or "it ended") from error
        raise self._broken("it did not answer")

    def _broken(self, why: str) -> JailFault:
        GRADERS_BROKEN.inc()
        self._process.kill()
        return JailFault(f"grading process {self._process.pid} broke: {why}")


class Graders:
    """`count` grading processes; thread-safe. A process that ended is replaced before the next script."""

    def __init__(self, count: int, *, allow_t2: bool) -> None:
        self._count, self._allow_t2 = count, allow_t2
        self._free: queue.SimpleQueue[int] = queue.SimpleQueue()
        self._all: list[GradingProcess] = []
        self.jail: Mapping[str, Any] = {}

    def begin(self) -> None:
        """Starts the first process without waiting for it; `start` does."""
        self._all = [self._new() for _ in range(self._count)]
        for first in self._all[:1]:
            first.begin()

    def start(self) -> None:
        """Starts the processes, and waits for the first: the others would take the cores from it and from a server that
        starts. A script that one of them gets waits until it is ready. Raises JailRefused."""
        if not self._all:
            self.begin()
        try:
            self._all[0].wait_until_ready()
        except JailFault:
            self.close()
            raise
        for place, process in enumerate(self._all):
            process.begin()
            self._free.put(place)
        self.jail = self._all[0].jail

    def judge(self, library: "Library", script: ScriptJob, tell: "Tell" = ignore_progress) -> "Verdict":
        """Judges a script in a free process; waits for one. Raises as a process does."""
        with self._free_process() as process:
            return process.judge(library, script, tell)

    def stop(self, name: str) -> None:
        """Has the script of this name end, in whichever process it runs."""
        for process in self._all:
            process.stop(name)

    def pids(self) -> list[int]:
        """Returns the ids of the processes."""
        return [process.pid for process in self._all]

    @property
    def alive(self) -> int:
        """The number of processes that run."""
        return sum(process.alive for process in self._all)

    @property
    def busy(self) -> int:
        """The number of processes with a script in progress."""
        return max(0, len(self._all) - self._free.qsize())

    def revive(self) -> None:
        """Replaces a process if none runs any more. Raises JailFault."""
        if self._all and not self.alive:
            with self._free_process():
                pass

    def close(self) -> None:
        """Ends every process; scripts in progress end with a JailFault."""
        ending = [threading.Thread(target=process.close) for process in self._all]
        for thread in ending:
            thread.start()
        for thread in ending:
            thread.join()
        self._all = []

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _new(self) -> GradingProcess:
        return GradingProcess(allow_t2=self._allow_t2)

    @contextmanager
    def _free_process(self) -> Iterator[GradingProcess]:
        place = self._free.get()
        try:
            if not self._all[place].alive:
                self._replace(place)
            yield self._all[place]
        finally:
            self._free.put(place)

    def _replace(self, place: int) -> None:
        ended = self._all[place]
        log.warning("a grading process ended and is replaced", pid=ended.pid)
        ended.close()
        self._all[place] = self._new()
        self._all[place].wait_until_ready()


def make_portable(library: "Library") -> "Library":
    """Returns the same content in plain dictionaries, which can be pickled, without the files that it was made of."""
    mappings: dict[str, Any] = {
        name: dict(value) for name, value in vars(library).items() if isinstance(value, Mapping)
    }
    return replace(library, **mappings | {"sources": {}})


def write_models(library: "Library", folder: Path) -> None:
    """Makes a folder hold the models of the content, and no others. No script may run meanwhile."""
    for name in {path.stem for path in folder.iterdir()} - library.models.keys():
        (folder / f"{name}.xml").unlink()
    for name, xml in library.models.items():
        (folder / f"{name}.xml").write_bytes(xml.encode())
