"""`/healthz`: the process answers. `/readyz`: it can grade."""

from typing import Any

import structlog
from fastapi import APIRouter
from fastapi.responses import JSONResponse, Response

from grader.api.context import AppContext, Check
from grader.api.problems import documented, problem

router = APIRouter()
log = structlog.get_logger()


@router.get("/healthz")
async def healthz() -> dict[str, str]:
    """The process answers."""
    return {"status": "ok"}


@router.get("/readyz", responses=documented(503))
def readyz(context: AppContext) -> Response:
    """The state of database, content and jail; 503 if one of them does not work."""
    found = {name: outcome(name, check) for name, check in context.checks.items()}
    if all(result["ok"] for result in found.values()):
        return JSONResponse({"status": "ready", "checks": found})
    failed = ", ".join(name for name, result in found.items() if not result["ok"])
    return problem(503, f"Not ready: {failed}.", checks=found)


def outcome(name: str, check: Check) -> dict[str, Any]:
    """What one check found. The reason of a failure is logged, not shown."""
    try:
        return {"ok": True, **check()}
    except Exception:
        log.exception("not ready", check=name)
        return {"ok": False}
