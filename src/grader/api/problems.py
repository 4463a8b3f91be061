"""Every error as RFC 9457 `application/problem+json`, mapped in this one place."""

import re
from collections.abc import Mapping
from http import HTTPStatus
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse, Response
from starlette.exceptions import HTTPException

from grader.errors import CallerError, ContentError, GraderError, InvalidAnswer, TooManyRequests, Unauthorized

MEDIA_TYPE = "application/problem+json"
SCHEMA = {
    "type": "object",
    "required": ["type", "title", "status", "detail"],
    "properties": {
        "type": {"type": "string"},
        "title": {"type": "string"},
        "status": {"type": "integer"},
        "detail": {"type": "string"},
        "errors": {"type": "array", "items": {"type": "object"}},
        "faults": {"type": "array", "items": {"type": "object"}},
    },
}


class ProblemResponse(JSONResponse):
    """A problem document."""

    media_type = MEDIA_TYPE


Responses = dict[int | str, dict[str, Any]]


def documented(*statuses: int, more: Responses | None = None) -> Responses:
    """The problems of a route for its OpenAPI description, and what else it may answer."""
    return (more or {}) | {
        status: {"description": HTTPStatus(status).phrase, "content": {MEDIA_TYPE: {"schema": SCHEMA}}}
        for status in statuses
    }


def problem(status: int, detail: str, headers: Mapping[str, str] | None = None, **more: Any) -> Response:
    """The problem document of one error; `more` are further members."""
    title = HTTPStatus(status).phrase
    body = {"type": "about:blank", "title": title, "status": status, "detail": detail, **more}
    return ProblemResponse(body, status, headers)


def problem_of(error: GraderError) -> Response:
    """The problem document of one of our own errors."""
    match error:
        case TooManyRequests():
            return problem(error.status, str(error), {"Retry-After": str(error.retry_after_s)})
        case Unauthorized():
            return problem(error.status, str(error), {"WWW-Authenticate": "Bearer"})
        case CallerError():
            return problem(error.status, str(error))
        case ContentError():
            faults = [vars(fault) for fault in error.faults]
            return problem(422, "The content has faults; what was loaded before stays.", faults=faults)
        case InvalidAnswer():
            return problem(422, str(error))
    raise error


def install(app: FastAPI) -> None:
    """Every error that is raised on purpose; what is not, the gate answers."""

    @app.exception_handler(GraderError)
    async def ours(_request: Request, error: GraderError) -> Response:
        return problem_of(error)

    @app.exception_handler(HTTPException)
    async def frameworks(request: Request, error: HTTPException) -> Response:
        return problem_of_framework(request, error)

    @app.exception_handler(RequestValidationError)
    async def invalid(_request: Request, error: RequestValidationError) -> Response:
        errors = [{"at": list(item["loc"]), "why": item["msg"]} for item in error.errors()]
        told = "; ".join(f"{'.'.join(map(str, item['at']))}: {item['why']}" for item in errors)
        return problem(422, told, errors=errors)


def problem_of_framework(request: Request, error: HTTPException) -> Response:
    """What the framework itself refuses; it says 400 of a body that it cannot read, which is our 422."""
    if error.status_code == HTTPStatus.NO_CONTENT:
        return Response(status_code=204)
    status = 422 if error.status_code == HTTPStatus.BAD_REQUEST else error.status_code
    details = {
        404: f"There is nothing at {request.url.path}.",
        405: f"{request.method} is not possible here.",
        422: "The body is not JSON in UTF-8.",
    }
    headers = {"Allow": ", ".join(methods_at(request))} if status == HTTPStatus.METHOD_NOT_ALLOWED else error.headers
    return problem(status, details.get(status, str(error.detail)), headers)


def methods_at(request: Request) -> list[str]:
    """Every method of the path that was asked for; the router itself names those of one route only."""
    methods: set[str] = set()
    for template, operations in request.app.openapi()["paths"].items():
        pattern = re.sub(r"\\{[^/]*?\\}", "[^/]+", re.escape(template))
        if re.fullmatch(pattern, request.url.path):
            methods.update(name.upper() for name in operations)
    return sorted(methods)
