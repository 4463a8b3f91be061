"""The checks of readiness, and their results of a moment ago."""

import asyncio
import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import structlog
from fastapi.concurrency import run_in_threadpool

from grader.errors import NotReady

log = structlog.get_logger()

FRESH_S = 1.0
"""How long results are cached [s]: however many probe, the checks run once in this time."""

Check = Callable[[], dict[str, Any]]
"""A check of readiness: returns its result, raises NotReady where the service cannot work."""


@dataclass
class Readiness:
    """The checks by name. For the event loop; they run one after the other, in one thread at a time."""

    checks: dict[str, Check]
    _results: dict[str, Any] = field(default_factory=dict)
    _at: float = -math.inf
    _lock: asyncio.Lock = field(default_factory=asyncio.Lock)

    async def results(self) -> dict[str, Any]:
        """Returns the result of each check, at most `FRESH_S` ago."""
        async with self._lock:
            if time.monotonic() - self._at >= FRESH_S:
                self._results = await run_in_threadpool(self.run_checks)
                self._at = time.monotonic()
        return self._results

    def expire(self) -> None:
        """Makes the next probe run the checks."""
        self._at = -math.inf

    def run_checks(self) -> dict[str, Any]:
        """Runs every check."""
        return {name: run_check(name, check) for name, check in self.checks.items()}


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
