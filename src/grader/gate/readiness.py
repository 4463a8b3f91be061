"""The checks of readiness, and their results of a moment ago."""

import asyncio
import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import structlog

from grader.errors import NotReady
from grader.gate.single_call import DEADLINE_S, SingleCall

log = structlog.get_logger()

FRESH_S = 1.0
"""How long results are cached [s]: however many probe, the checks run once in this time."""

Check = Callable[[], dict[str, Any]]
"""A check of readiness: returns its result, raises NotReady where the service cannot work."""


@dataclass
class Readiness:
    """The checks by name. For the event loop; each runs in a thread of its own, once at a time. One that does not come
    back within `DEADLINE_S` has failed, and is not begun again before it has."""

    checks: dict[str, Check]
    _calls: dict[str, SingleCall[dict[str, Any]]] = field(default_factory=dict)
    _results: dict[str, Any] = field(default_factory=dict)
    _at: float = -math.inf
    _lock: asyncio.Lock = field(default_factory=asyncio.Lock)

    async def results(self) -> dict[str, Any]:
        """Returns the result of each check, at most `FRESH_S` ago."""
        async with self._lock:
            if time.monotonic() - self._at >= FRESH_S:
                self._results = await self._run_checks()
                self._at = time.monotonic()
        return self._results

    def expire(self) -> None:
        """Makes the next probe run the checks."""
        self._at = -math.inf

    async def _run_checks(self) -> dict[str, Any]:
        """Runs every check."""
        for name in self.checks:
            self._calls.setdefault(name, SingleCall(partial(self._run_check, name)))
        calls = {name: asyncio.wrap_future(self._calls[name].begin()) for name in self.checks}
        await asyncio.wait(calls.values(), timeout=DEADLINE_S)
        return {name: call.result() if call.done() else tell_hanging(name) for name, call in calls.items()}

    def _run_check(self, name: str) -> dict[str, Any]:
        return run_check(name, self.checks[name])


def tell_hanging(name: str) -> dict[str, Any]:
    """The result of a check that has not come back."""
    why = f"There is no answer after {DEADLINE_S:g} s."
    log.warning("not ready", check=name, why=why)
    return {"ok": False, "why": why}


def run_check(name: str, check: Check) -> dict[str, Any]:
    """Runs one check. Of an unexpected failure only the log says why."""
    try:
        return {"ok": True, **check()}
    except NotReady as error:
        log.warning("not ready", check=name, why=str(error))
        return {"ok": False, "why": str(error)}
    except Exception:
        log.exception("not ready", check=name)
        return {"ok": False, "why": "The check failed; the log says why."}
