"""The interface of the jail: `Jail.run(job)`, and the tier that this machine allows."""

import base64
import json
import os
import threading
from collections.abc import Callable, Sequence
from enum import StrEnum
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Self

from grader.domain.run import MODULE_BYTES_MAX, Job, Limits, RunReport, RunStatus
from grader.errors import JailFault, JailRefused
from grader.sandbox.locks import cell, cgroup, selftest
from grader.sandbox.policy import MB
from grader.sandbox.pool import Pool
from grader.sandbox.report import build_report
from grader.sandbox.talking import TalkingWatch
from grader.sandbox.watch import Watch
from grader.sandbox.zygote import Child, Zygote

QUEUE_S_MAX = 600.0
CHILD_S_MAX = 60.0
RECYCLE_AFTER = 2000
TRIES = 8
CODE_BYTES_MAX = 128 * 1024
"""The largest code object that is loaded ahead: a packet of the zygote's socket holds a little more."""
CURE = "docs/deploy.md says what it needs of a container; GRADER_ALLOW_T2=true accepts one without namespaces."


class Tier(StrEnum):
    """The layers of the jail that this machine allows: found at start, never lowered while running."""

    T0 = "T0"  # every layer
    T1 = "T1"  # without a delegated cgroup
    T2 = "T2"  # without namespaces: limits, Landlock and seccomp alone, no scratch directory; only when asked for


class Jail:
    """Runs students' scripts, `workers` at a time (default: one for each core); thread-safe; the rest wait in a queue.
    `models`: the folder of MJCF files that scripts may read. `allow_t2`: accept a machine without user namespaces.
    `codes`: code objects of drivers that the zygote loads ahead; a job that has others brings them. `recycle_after`:
    children that one zygote makes. `inside`: the folder of the code that runs in the cell; another one only in tests.
    Raises JailRefused if this machine does not allow the jail, or the self-test found a hole."""

    tier: Tier
    self_test: selftest.SelfTest

    def __init__(
        self,
        models: Path,
        workers: int | None = None,
        *,
        allow_t2: bool = False,
        codes: Sequence[bytes] = (),
        recycle_after: int = RECYCLE_AFTER,
        inside: Path = cell.INSIDE,
    ) -> None:
        if not models.is_dir():
            raise JailRefused(f"There is no folder of models at {models}.")
        self.workers = workers or os.cpu_count() or 1
        self._places = threading.Semaphore(self.workers)
        group = cgroup.find_delegated()
        ahead = [code for code in codes if len(code) <= CODE_BYTES_MAX]
        self._places_of_codes = {code: place for place, code in enumerate(ahead)}
        full = partial(Zygote, models, inside, group=group, codes=ahead)
        tries: list[tuple[Tier, Callable[[], Zygote]]] = [(Tier.T0 if group else Tier.T1, full)]
        if allow_t2:
            tries.append((Tier.T2, partial(Zygote, models, inside, alone=True, codes=ahead)))
        faults = []
        for self.tier, start in tries:
            self._pool = Pool(start, self.workers, recycle_after)
            try:
                self.self_test = selftest.run_selftest(self.run, lambda: self.keeps_integrators)
                return
            except JailRefused:  # a hole: a lower tier would have it too
                self.close()
                raise
            except JailFault as fault:
                self.close()
                faults.append(f"{self.tier}: {str(fault).rstrip('.')}.")
        raise JailRefused(f"The jail cannot be set up on this machine. {' '.join(faults)} {CURE}")

    def run(self, job: Job) -> RunReport:
        """Run one script to its end; blocks, and waits for a place when all are taken. Raises JailFault if
        the jail failed, not the script: try again; and ScriptStopped if the job `is_stopped`."""
        if len(job.source) > MODULE_BYTES_MAX:
            return RunReport(RunStatus.CRASHED, f"The script is larger than {MODULE_BYTES_MAX // 1024} KB.")
        if not self._places.acquire(timeout=QUEUE_S_MAX):
            raise JailFault("No place in the jail became free in time.")
        try:
            return self._run(job)
        finally:
            self._places.release()

    def run_beside(self, job: Job) -> RunReport:
        """Runs a job that lasts, as one does that waits for messages, beside the `workers`. Raises JailFault."""
        self._pool.widen(1)
        try:
            return self._run(job)
        finally:
            self._pool.widen(-1)

    def _run(self, job: Job) -> RunReport:
        # As an ASCII escape even a lone surrogate arrives, and the student's interpreter refuses it.
        first = {
            "source": job.source,
            "driver": job.driver,
            "codes": {name: self._refer_to(code) for name, code in job.codes.items()},
            "filename": job.filename.rpartition("/")[2] or "submission.py",
            "cpu_s": job.limits.cpu_s,
            "wall_s": job.limits.wall_s,
            "talks": job.talk is not None,
        }
        parts = [
            lambda: json.dumps(first).encode(),
            lambda: json.dumps(dict(job.inputs)).encode(),
            lambda: json.dumps({**job.hidden_inputs, **job.late_inputs()}).encode(),
        ]
        child = self._limited_child(job.limits)
        try:
            removes = job.without_integrators and not child.zygote.keeps_integrators
            watch = TalkingWatch if job.talk else Watch
            return build_report(watch(child, job, parts, without_integrators=removes).run(), job)
        except OSError as error:
            raise JailFault(f"The jail broke: {error}") from error
        finally:
            self._pool.give_back(child)

    def _refer_to(self, code: bytes) -> int | str:
        """Return the place of a code object that the zygote has loaded, or else its text."""
        place = self._places_of_codes.get(code)
        return base64.b64encode(code).decode() if place is None else place

    def _limited_child(self, limits: Limits) -> Child:
        """Return a spare with this job's limits; a spare that died while it waited is replaced by the next."""
        for _ in range(TRIES):
            child = self._pool.take(CHILD_S_MAX)
            try:
                child.limit(limits.memory_mb * MB, limits.cpu_s)
                return child
            except JailFault as fault:
                self._pool.give_back(child)
                broken = fault
        raise broken

    @property
    def keeps_integrators(self) -> str:
        """The reason why MuJoCo's integrators cannot be removed on this machine; empty where they can."""
        return self._pool.keeps_integrators

    @property
    def restarts(self) -> int:
        """The number of times that a dead zygote was replaced."""
        return self._pool.restarts

    def close(self) -> None:
        """End every process of the jail; jobs that still run end with a JailFault."""
        self._pool.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
