"""Every error as RFC 9457 `application/problem+json`: the one place that gives errors their HTTP status."""

from collections.abc import Callable, Mapping
from http import HTTPStatus
from typing import Any

import structlog
from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse, Response
from starlette.exceptions import HTTPException
from starlette.routing import Match
from starlette.types import Receive, Scope, Send

from grader.errors import (
    Conflict,
    ContentError,
    FaultyRows,
    Forbidden,
    GraderError,
    InvalidAnswer,
    LabRefused,
    NotFound,
    Outdated,
    TooLarge,
    TooManyRequests,
    Unauthorized,
    Unconditional,
    Unprocessable,
    WrongMoments,
)
from grader.store.engine.database import is_away, is_of_other_tables

MEDIA_TYPE = "application/problem+json"
SCHEMA = {
    "type": "object",
    "required": ["type", "title", "status", "detail"],
    "properties": {
        "type": {"type": "string"},
        "title": {"type": "string"},
        "status": {"type": "integer"},
        "detail": {"type": "string"},
        "request_id": {"type": "string"},
        "errors": {"type": "array", "items": {"type": "object"}},
        "faults": {"type": "array", "items": {"type": "object"}},
    },
}


RETRY_S = 5
"""When to try again while the service cannot serve [s]."""

ERRORS_MAX = 20
"""Errors of one body that are listed."""


class ProblemResponse(JSONResponse):
    """A problem document; for a browser that opens a page, the page that `install` was given for it."""

    media_type = MEDIA_TYPE

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Sends the document or the page."""
        page: Response | None = scope["app"].state.error_page(scope, self)
        await (super().__call__ if page is None else page)(scope, receive, send)


ErrorPage = Callable[[Scope, Response], Response | None]
"""Makes the page of a problem document for a browser that opens a page; None for any other client."""


Responses = dict[int | str, dict[str, Any]]


def refusals(*statuses: int, more: Responses | None = None) -> Responses:
    """The `responses` of a route for OpenAPI: those in `more`, and statuses whose problems `openapi.py` describes."""
    return (more or {}) | {status: {"description": HTTPStatus(status).phrase} for status in statuses}


def problem(status: int, detail: str, headers: Mapping[str, str] | None = None, **more: Any) -> Response:
    """A problem document; `more` are its extension members."""
    named = structlog.contextvars.get_contextvars()  # the id of the request
    return ProblemResponse(problem_body(status, detail, **more, **named), status, headers)


def problem_body(status: int, detail: str, **more: Any) -> dict[str, Any]:
    """The members of a problem document."""
    return {"type": "about:blank", "title": HTTPStatus(status).phrase, "status": status, "detail": detail, **more}


STATUS: dict[type[GraderError], int] = {
    Unauthorized: 401, Forbidden: 403, NotFound: 404, Conflict: 409, Outdated: 412, TooLarge: 413, ContentError: 422,
    FaultyRows: 422, InvalidAnswer: 422, LabRefused: 422, Unprocessable: 422, WrongMoments: 422, Unconditional: 428,
    TooManyRequests: 429,
}  # fmt: skip
"""The HTTP status of every error that a request can cause. Any other error is our fault: 500."""


def describe_problem(error: GraderError) -> Response:
    """The problem document of one of our own errors. Raises the error again where it is not the caller's."""
    status = STATUS.get(type(error))
    if status is None:
        raise error
    match error:
        case TooManyRequests():
            return problem(status, str(error), {"Retry-After": str(error.retry_after_s)})
        case Unauthorized():
            return problem(status, str(error), {"WWW-Authenticate": "Bearer"})
        case ContentError():
            faults = [vars(fault) for fault in error.faults]
            return problem(status, "The content has faults; what was loaded before stays.", faults=faults)
        case FaultyRows():
            faults = [vars(fault) for fault in error.faults]
            return problem(status, "Rows of the file cannot be taken, so that none was.", faults=faults)
        case _:
            return problem(status, str(error))


def problem_of_unexpected(error: Exception) -> Response:
    """The problem document of an unexpected error: 503 if the database is away or its tables are not ours, else 500."""
    if is_away(error):
        return problem(503, "The service cannot reach or write its data now. Try again.", {"Retry-After": str(RETRY_S)})
    if is_of_other_tables(error):
        why = "The tables of the database are not those that this version needs; /readyz tells more."
        return problem(503, why, {"Retry-After": str(RETRY_S)})
    return problem(500, "Something went wrong on our side.")


def install(app: FastAPI, error_page: ErrorPage) -> None:
    """Registers the handlers of every error that is raised on purpose; RequestsMiddleware answers all others."""
    app.state.error_page = error_page

    @app.exception_handler(GraderError)
    async def on_grader_error(_request: Request, error: GraderError) -> Response:
        return describe_problem(error)

    @app.exception_handler(HTTPException)
    async def on_http_exception(request: Request, error: HTTPException) -> Response:
        return problem_of_framework(request, error)

    @app.exception_handler(RequestValidationError)
    async def on_invalid_request(_request: Request, error: RequestValidationError) -> Response:
        errors = [{"at": list(item["loc"]), "why": item["msg"]} for item in error.errors()[:ERRORS_MAX]]
        detail = "; ".join(f"{'.'.join(map(str, item['at']))}: {item['why']}" for item in errors)
        return problem(422, detail, errors=errors)

    @app.exception_handler(Exception)
    async def on_unexpected(_request: Request, error: Exception) -> Response:
        raise error  # past FastAPI, which would answer it


def problem_of_framework(request: Request, error: HTTPException) -> Response:
    """The problem document of an error that the framework raised. Its 400 for an unreadable body becomes 422."""
    if error.status_code == HTTPStatus.NO_CONTENT:
        return Response(status_code=204)
    status = 422 if error.status_code == HTTPStatus.BAD_REQUEST else error.status_code
    details = {
        404: f"There is nothing at {request.url.path}.",
        405: f"{request.method} is not possible here.",
        422: "The body is not JSON in UTF-8.",
    }
    headers = {"Allow": ", ".join(list_methods(request))} if status == HTTPStatus.METHOD_NOT_ALLOWED else error.headers
    return problem(status, details.get(status, str(error.detail)), headers)


def list_methods(request: Request) -> list[str]:
    """Every method that the requested path allows, of the API or a page. The router itself names the methods of one
    route only. HEAD is answered wherever GET is."""
    methods: set[str] = set()
    for route in request.app.routes:
        if route.matches(request.scope)[0] is not Match.NONE:
            methods.update(getattr(route, "methods", None) or ())
    return sorted(methods | ({"HEAD"} if "GET" in methods else set()))
