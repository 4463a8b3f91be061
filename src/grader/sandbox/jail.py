"""The door of the sandbox: `Jail.run(job)`."""

import json
import os
import threading
from pathlib import Path
from types import TracebackType
from typing import Self

from ..domain.run import SOURCE_BYTES_MAX, Job, RunReport, RunStatus
from ..errors import JailFault, JailRefused
from . import cell, selftest
from .policy import MB
from .pool import Pool
from .report import report
from .tier import Tier
from .watch import Watch
from .zygote import Zygote, lower

QUEUE_S_MAX = 600.0
CHILD_S_MAX = 60.0
RECYCLE_AFTER = 2000


class Jail:
    """Runs students' scripts, `workers` at a time; thread-safe; the rest wait in a queue.

    `models` is the folder of MJCF files that scripts may read. `allow_t2` accepts a machine without user namespaces.

    Raises:
        JailRefused: this machine cannot hold the jail, or the self-test found a hole.
    """

    def __init__(
        self,
        models: Path,
        workers: int | None = None,
        *,
        spares: int | None = None,
        allow_t2: bool = False,
        recycle_after: int = RECYCLE_AFTER,
        inside: Path = cell.INSIDE,
    ) -> None:
        self.workers = workers or os.cpu_count() or 1
        self._places = threading.Semaphore(self.workers)
        self._closed = False
        self.tier = Tier.T1
        self._pool = Pool(lambda: Zygote(models, inside), self.workers if spares is None else spares, recycle_after)
        try:
            self.self_test = selftest.run(self.run)
        except JailFault as fault:
            self.close()
            raise JailRefused(str(fault)) from fault
        except BaseException:
            self.close()
            raise

    def run(self, job: Job) -> RunReport:
        """Run one script to its end; blocks, and waits for a place when all are taken.

        Raises:
            JailFault: the jail broke, not the script; worth one more try.
        """
        if len(job.source) > SOURCE_BYTES_MAX:
            return RunReport(RunStatus.CRASHED, f"The script is larger than {SOURCE_BYTES_MAX // 1024} KB.")
        if not self._places.acquire(timeout=QUEUE_S_MAX):
            raise JailFault("The jail had no room in time.")
        try:
            return self._run(job)
        finally:
            self._places.release()

    def _run(self, job: Job) -> RunReport:
        packed = json.dumps(
            {
                "source": job.source,
                "driver": job.driver,
                "inputs": dict(job.inputs),
                "filename": Path(job.filename).name,
            }
        ).encode()
        child = self._pool.take(CHILD_S_MAX)
        try:
            lower(child, job.limits.memory_mb * MB, -int(-job.limits.cpu_s // 1))
            return report(Watch(child, job.limits, packed).run(), job.limits)
        except OSError as error:
            raise JailFault(f"The jail broke: {error}") from error
        finally:
            self._pool.give_back(child)

    def close(self) -> None:
        """End every process of the jail."""
        if not self._closed:
            self._closed = True
            self._pool.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
