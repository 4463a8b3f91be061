"""Keeps children ready: one thread owns the zygote, makes its children, and replaces it when it is worn out or dead. A
child is made when one has ended, not when one begins: what is prepared for the verdict has the other core meanwhile."""

import threading
import time
from collections import deque
from collections.abc import Callable

from grader.errors import JailFault
from grader.sandbox.zygote import Child, Zygote

RETRY_S, RETRY_S_MAX = 0.2, 5.0
RETRIES = 3


class Pool:
    """Holds a zygote and `places` children, which are ready, or run a job between `take` and `give_back`. They belong
    to one long-lived thread, as the cell dies with its thread. Raises JailFault if the first zygote does not start."""

    def __init__(self, start: Callable[[], Zygote], places: int, recycle_after: int) -> None:
        self._start, self._free, self._recycle_after = start, places, recycle_after
        self._ready: deque[Child] = deque()
        self._change = threading.Condition()
        self._closing = False
        self._fault: JailFault | None = None
        self._zygote: Zygote | None = None
        self._retired: list[Zygote] = []
        self.restarts = 0
        self.keeps_integrators = ""
        self._keeper = threading.Thread(target=self._keep, name="jail-keeper", daemon=True)
        self._keeper.start()

    def take(self, patience_s: float) -> Child:
        """Take a child that is ready, or wait for one. Raises JailFault if none could be made."""
        deadline = time.monotonic() + patience_s
        with self._change:
            while True:
                if self._closing:
                    raise JailFault("The jail is closed.")
                while self._ready:
                    child = self._ready.popleft()
                    self._change.notify_all()
                    if child.alive():
                        self._free -= 1
                        return child
                    child.close()
                if self._fault is not None:
                    raise JailFault(str(self._fault))
                if not self._change.wait(max(0.0, deadline - time.monotonic())):
                    raise JailFault("No place in the jail became free in time.")

    def give_back(self, child: Child) -> None:
        """Close a dead child whose pipes have been read."""
        child.close()
        with self._change:
            self._free += 1
            self._change.notify_all()

    def widen(self, places: int) -> None:
        """Add places, or take free ones away."""
        with self._change:
            self._free += places
            self._change.notify_all()

    def close(self) -> None:
        """End every process, and wait until they have ended."""
        with self._change:
            self._closing = True
            self._change.notify_all()
        self._keeper.join()

    def _keep(self) -> None:
        failures = 0
        while True:
            with self._change:
                self._change.wait_for(self._needed, timeout=1.0)
                if self._closing:
                    break
            self._drop_retired()
            try:
                zygote = self._living()
                child = zygote.child() if self._lacking() else None
                failures = 0
            except (JailFault, OSError) as fault:
                failures += 1
                self._broken(fault, failures)
                continue
            with self._change:
                self._fault = None
                if child is not None:
                    self._ready.append(child)
                self._change.notify_all()
        self._end()

    def _needed(self) -> bool:
        dead = self._zygote is None or not self._zygote.alive()
        return self._closing or self._lacking() or dead or any(not zygote.children for zygote in self._retired)

    def _lacking(self) -> bool:
        return len(self._ready) < self._free

    def _living(self) -> Zygote:
        """Return the zygote in use; start a new one when it has died or has made enough children."""
        if self._zygote is not None and not self._zygote.alive():
            self.restarts += 1
            self._retire()
        if self._zygote is not None and self._zygote.made >= self._recycle_after:
            self._retire()
        if self._zygote is None:
            self._zygote = self._start()
            self.keeps_integrators = self._zygote.keeps_integrators
        return self._zygote

    def _retire(self) -> None:
        if self._zygote is not None:
            self._retired.append(self._zygote)
            self._zygote = None

    def _drop_retired(self) -> None:
        """End retired zygotes whose last child is gone, and drop spares that died with theirs."""
        with self._change:
            living = deque(child for child in self._ready if child.alive())
            for child in self._ready:
                if child not in living:
                    child.close()
            self._ready = living
            done = [zygote for zygote in self._retired if not zygote.children]
            self._retired = [zygote for zygote in self._retired if zygote.children]
        for zygote in done:
            zygote.close()

    def _broken(self, fault: Exception, failures: int) -> None:
        self._retire()
        with self._change:
            if failures >= RETRIES:
                self._fault = JailFault(str(fault))
            self._change.notify_all()
            self._change.wait_for(lambda: self._closing, timeout=min(RETRY_S * failures, RETRY_S_MAX))

    def _end(self) -> None:
        with self._change:
            ready, self._ready = list(self._ready), deque()
        for child in ready:
            child.close()
        self._retire()
        for zygote in self._retired:
            zygote.close()
        self._retired = []
