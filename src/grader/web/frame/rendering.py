"""Rendering of the templates, with the headers that every page has."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from fastapi import Request
from fastapi.responses import Response
from fastapi.templating import Jinja2Templates
from jinja2 import ChoiceLoader, FileSystemLoader, FunctionLoader

from grader.courses.rules.policy import spoken
from grader.gate.services import services_in
from grader.store import platforms
from grader.web.frame.assets import static
from grader.web.text import numbers
from grader.web.text.prose import cached_prose
from grader.web.text.question_templates import load_template
from grader.web.verdict import card

ROOM = Path(__file__).parents[1]

POLICY = "Content-Security-Policy"


def security_policy(framed_by: Iterable[str] = (), posts_to: Iterable[str] = ()) -> str:
    """The security policy of a page that these origins may show in a frame, and whose forms may go to others. Scripts,
    styles and fonts come from files of this service only; authors may show pictures from other sites."""
    return (
        "default-src 'none'; script-src 'self'; style-src 'self'; font-src 'self'; img-src 'self' data: https:; "
        f"connect-src 'self'; form-action {source_list(posts_to)}; base-uri 'none'; "
        f"frame-ancestors {source_list(framed_by)}"
    )


def source_list(origins: Iterable[str]) -> str:
    """The service itself and these origins."""
    return " ".join(("'self'", *origins))


HEADERS = {
    POLICY: security_policy(),
    "Referrer-Policy": "same-origin",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "private, no-cache",
}

templates = Jinja2Templates(directory=ROOM / "templates")
templates.env.loader = ChoiceLoader([FileSystemLoader(ROOM / "templates"), FunctionLoader(load_template)])
templates.env.trim_blocks = templates.env.lstrip_blocks = True
templates.env.globals["static"] = static
templates.env.filters |= {
    "fraction": numbers.fraction,
    "lines_linked": card.lines_linked,
    "number": numbers.number,
    "plain": numbers.field_text,
    "points": numbers.points,
    "prose": cached_prose,
    "spoken": spoken,
    "remark": numbers.remark,
    "unbroken": numbers.unbroken,
}


def page(
    request: Request, template: str, status: int = 200, more: Mapping[str, str] | None = None, **context: Any
) -> Response:
    """Renders a template, with the headers that every page has, and `more`. In a session that a learning platform
    launched, the platform may show the page in a frame."""
    headers = HEADERS | dict(more or {})
    who = getattr(request.state, "identity", None)
    if who is not None and who.platform is not None and POLICY not in (more or {}):
        headers[POLICY] = security_policy(origins_of(request, who.platform))
    return templates.TemplateResponse(request, template, context, status_code=status, headers=headers)


def origins_of(request: Request, platform_id: int) -> tuple[str, ...]:
    """The origins whose pages may show ours in a frame; none once the platform is removed."""
    with services_in(request.app).database.read() as session:
        row = platforms.get(session, platform_id)
        return () if row is None else platforms.view(row).origins
