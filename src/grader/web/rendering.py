"""Rendering of the templates, with the headers that every page has."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fastapi import Request
from fastapi.responses import Response
from fastapi.templating import Jinja2Templates

ROOM = Path(__file__).parent

HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: https:; connect-src 'self'; "
        "form-action 'self'; base-uri 'none'; frame-ancestors 'self'"
    ),
    "Referrer-Policy": "same-origin",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "private, no-cache",
}
"""Scripts and styles come from files of this service only; authors may show pictures from other sites."""

templates = Jinja2Templates(directory=ROOM / "templates")
templates.env.trim_blocks = templates.env.lstrip_blocks = True


def page(
    request: Request, template: str, status: int = 200, more: Mapping[str, str] | None = None, **context: Any
) -> Response:
    """Renders a template, with the headers that every page has, and `more`."""
    headers = HEADERS | dict(more or {})
    return templates.TemplateResponse(request, template, context, status_code=status, headers=headers)
