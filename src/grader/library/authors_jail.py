"""The jail in which a process that loads content calls authors' programs: one for the process, opened with the first
call that nothing has kept. No student's script enters it."""

import atexit
import sys
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Lock
from typing import TYPE_CHECKING

from grader.domain.run import Job, RunReport
from grader.errors import JailRefused
from grader.settings import Settings

if TYPE_CHECKING:
    from grader.sandbox.jail import Jail

_opening = Lock()


def run_in_authors_jail(job: Job) -> RunReport:
    """Runs a job that lasts in the jail of this process. Raises JailFault; JailRefused on a machine without a jail."""
    with _opening:
        jail = open_jail()
    if isinstance(jail, JailRefused):
        raise jail
    return jail.run_beside(job)


@cache
def open_jail() -> "Jail | JailRefused":
    """Opens the jail, which is closed with the process; or returns why the machine allows none."""
    if sys.platform != "linux":
        return JailRefused("The jail needs Linux.")
    from grader.sandbox.jail import Jail

    models = TemporaryDirectory(prefix="grader-models-")  # MJCF text comes with each call
    atexit.register(models.cleanup)
    Path(models.name).chmod(0o755)
    try:
        return Jail(Path(models.name), 1, allow_t2=Settings().allow_t2)
    except JailRefused as refused:
        return refused


@atexit.register
def close_jail() -> None:
    """Closes the jail, if it is open. A later call opens another."""
    with _opening:
        jail = open_jail() if open_jail.cache_info().currsize else None
        if jail is not None and not isinstance(jail, JailRefused):
            jail.close()
            open_jail.cache_clear()
