"""`/healthz`: the process answers. `/readyz`: it can grade."""

from collections.abc import Callable, Mapping
from typing import Any

import structlog
from fastapi import APIRouter, Request
from fastapi.responses import JSONResponse, Response

from grader.api.problems import documented, problem

router = APIRouter()
log = structlog.get_logger()

Check = Callable[[], dict[str, Any]]
"""Says what it found; raises where that is not enough to work with."""


@router.get("/healthz")
async def healthz() -> dict[str, str]:
    """The process answers."""
    return {"status": "ok"}


@router.get("/readyz", responses=documented(503))
def readyz(request: Request) -> Response:
    """Database, content and jail, each with what it is; 503 where one does not work."""
    checks: Mapping[str, Check] = request.app.state.checks
    found = {name: outcome(name, check) for name, check in checks.items()}
    if all(result["ok"] for result in found.values()):
        return JSONResponse({"status": "ready", "checks": found})
    failed = ", ".join(name for name, result in found.items() if not result["ok"])
    return problem(503, f"Not ready: {failed}.", checks=found)


def outcome(name: str, check: Check) -> dict[str, Any]:
    """What one check found; why it failed stands in the log, not here."""
    try:
        return {"ok": True, **check()}
    except Exception:
        log.exception("not ready", check=name)
        return {"ok": False}
