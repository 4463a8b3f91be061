"""The checks of readiness, and what they found a moment ago."""

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
"""How long findings are kept [s]: however many probe, the checks run once in this time."""

Check = Callable[[], dict[str, Any]]
"""A check of readiness: returns what it found, raises NotReady where the service cannot work."""


@dataclass
class Readiness:
    """The checks by name. For the event loop; they run one after the other, in one thread at a time."""

    checks: dict[str, Check]
    _found: dict[str, Any] = field(default_factory=dict)
    _at: float = -math.inf
    _lock: asyncio.Lock = field(default_factory=asyncio.Lock)

    async def found(self) -> dict[str, Any]:
        """What each check found, at most `FRESH_S` ago."""
        async with self._lock:
            if time.monotonic() - self._at >= FRESH_S:
                self._found = await run_in_threadpool(self.look)
                self._at = time.monotonic()
        return self._found

    def forget(self) -> None:
        """Lets the next probe run the checks."""
        self._at = -math.inf

    def look(self) -> dict[str, Any]:
        """What each check finds now."""
        return {name: outcome(name, check) for name, check in self.checks.items()}


def outcome(name: str, check: Check) -> dict[str, Any]:
    """What one check found. Of an unexpected failure only the log says why."""
    try:
        return {"ok": True, **check()}
    except NotReady as error:
        log.warning("not ready", check=name, why=str(error))
        return {"ok": False, "why": str(error)}
    except Exception:
        log.exception("not ready", check=name)
        return {"ok": False, "why": "The check failed; the log says why."}
