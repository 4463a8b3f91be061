"""`/healthz`: the process answers. `/readyz`: it can grade. `/metrics`: how it does, for Prometheus."""

import asyncio
import secrets
from typing import Annotated

from fastapi import APIRouter, Header
from fastapi.responses import JSONResponse, PlainTextResponse, Response
from prometheus_client import CONTENT_TYPE_LATEST

from grader.api.views import Ready
from grader.errors import Forbidden, Unauthorized
from grader.gate.late_routes import LateRoute
from grader.gate.problems import RETRY_S, problem, refusals
from grader.gate.services import AppServices, Services

router = APIRouter(tags=["health"], route_class=LateRoute)

NO_STORE = {"Cache-Control": "no-store"}


@router.get("/healthz", responses=refusals(429))
async def show_health() -> dict[str, str]:
    """The process answers."""
    return {"status": "ok"}


@router.get("/readyz", response_class=JSONResponse, responses=refusals(429, 503, more={200: {"model": Ready}}))
async def show_readiness(services: AppServices) -> Response:
    """What database, content, jail and workers say, at most a second ago; 503 if one of them does not work."""
    results = await services.readiness.results()
    failed = {name: result["why"] for name, result in results.items() if not result["ok"]}
    if not failed:
        return JSONResponse({"status": "ready", "checks": results}, headers=NO_STORE)
    detail = " ".join(f"{name}: {why}" for name, why in failed.items())
    return problem(503, detail, NO_STORE | {"Retry-After": str(RETRY_S)}, checks=results)


@router.get("/metrics", response_class=PlainTextResponse, responses=refusals(401, 403, 422, 429))
async def show_metrics(services: AppServices, authorization: Annotated[str, Header(max_length=1000)] = "") -> Response:
    """Metrics in Prometheus' text format: of this process, and of the queue in the database.

    Open on loopback without `GRADER_PUBLIC_ORIGIN`; elsewhere, or where `GRADER_METRICS_TOKEN` is set, for its bearer.
    """
    require_token(services, authorization)
    text = await asyncio.wrap_future(services.monitor.shown.begin())
    return Response(text, headers=NO_STORE, media_type=CONTENT_TYPE_LATEST)


def require_token(services: Services, authorization: str) -> None:
    """Raises Unauthorized without the token of the settings, and Forbidden where one is needed and none is set."""
    if services.settings.metrics_token is None:
        if services.settings.public_origin is not None:
            raise Forbidden("Metrics are closed on a public server: set GRADER_METRICS_TOKEN to open them.")
        return
    wanted = f"Bearer {services.settings.metrics_token.get_secret_value()}"
    if not secrets.compare_digest(authorization.encode(), wanted.encode()):
        raise Unauthorized("Send GRADER_METRICS_TOKEN as `Authorization: Bearer ...`.")
