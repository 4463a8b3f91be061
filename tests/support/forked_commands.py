"""`grader` commands as processes of their own, forked from one that has imported the grader: to import it takes two
seconds of CPU time, and a dozen tests start, kill and start again."""

import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import get_context
from multiprocessing.context import ForkServerProcess
from pathlib import Path

FORKING = get_context("forkserver")
FORKING.set_forkserver_preload(["grader.commands.main", "grader.service.serving", "grader.service.app"])


@dataclass(frozen=True)
class Forked:
    """A running command, as `subprocess` would hold it."""

    pid: int
    process: ForkServerProcess

    def poll(self) -> int | None:
        """The exit code, None while it runs."""
        return self.process.exitcode

    def wait(self, timeout_s: float) -> int | None:
        """The exit code once it has ended, None if it does not in this time."""
        self.process.join(timeout_s)
        return self.process.exitcode

    def terminate(self) -> None:
        """Asks it to end."""
        self.process.terminate()


@contextmanager
def fork_command(command: str, environment: Mapping[str, str], before: str, log: Path | None) -> Iterator[Forked]:
    """Runs a command with this environment; kills it at the end, whatever the test has done to it.

    The process runs the code `before` first, and writes its log to `log`.
    """
    process = FORKING.Process(target=run_command, args=(command, dict(environment), before, log))
    process.start()
    assert process.pid is not None
    try:
        yield Forked(process.pid, process)
    finally:
        process.kill()
        process.join()
        process.close()


def run_command(command: str, environment: dict[str, str], before: str, log: Path | None) -> None:
    """Becomes the command."""
    os.environ.clear()
    os.environ.update(environment)
    nothing = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nothing, sys.stdout.fileno())
    if log is not None:
        os.dup2(os.open(log, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o600), sys.stderr.fileno())
    exec(before, {})
    sys.argv = ["grader", command]
    from grader.commands.main import main

    main()
