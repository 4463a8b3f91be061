"""Rendering of the templates, with the headers that every page has."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from fastapi import Request
from fastapi.responses import Response
from fastapi.templating import Jinja2Templates

from grader.courses.policy import spoken
from grader.store import platforms
from grader.web import figures, verdict_card
from grader.web.assets import static

ROOM = Path(__file__).parent

POLICY = "Content-Security-Policy"


def security_policy(framed_by: Iterable[str] = (), posts_to: Iterable[str] = ()) -> str:
    """The security policy of a page that these origins may show in a frame, and whose forms may go to others.

    Scripts, styles and fonts come from files of this service only; authors may show pictures from other sites.
    """
    return (
        "default-src 'none'; script-src 'self'; style-src 'self'; font-src 'self'; img-src 'self' data: https:; "
        f"connect-src 'self'; form-action {listed(posts_to)}; base-uri 'none'; frame-ancestors {listed(framed_by)}"
    )


def listed(origins: Iterable[str]) -> str:
    """The service itself and these origins."""
    return " ".join(("'self'", *origins))


HEADERS = {
    POLICY: security_policy(),
    "Referrer-Policy": "same-origin",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "private, no-cache",
}

templates = Jinja2Templates(directory=ROOM / "templates")
templates.env.trim_blocks = templates.env.lstrip_blocks = True
templates.env.globals["static"] = static
templates.env.filters |= {
    "fraction": figures.fraction,
    "lines_linked": verdict_card.lines_linked,
    "number": figures.number,
    "plain": figures.field_text,
    "points": figures.points,
    "spoken": spoken,
    "remark": figures.remark,
    "unbroken": figures.unbroken,
}


def page(
    request: Request, template: str, status: int = 200, more: Mapping[str, str] | None = None, **context: Any
) -> Response:
    """Renders a template, with the headers that every page has, and `more`.

    In a session that a learning platform launched, the platform may show the page in a frame.
    """
    headers = HEADERS | dict(more or {})
    who = getattr(request.state, "identity", None)
    if who is not None and who.platform is not None and POLICY not in (more or {}):
        headers[POLICY] = security_policy(origins_of(request, who.platform))
    return templates.TemplateResponse(request, template, context, status_code=status, headers=headers)


def origins_of(request: Request, platform_id: int) -> tuple[str, ...]:
    """The origins whose pages may show ours in a frame; none once the platform is removed."""
    with request.app.state.pages.database.read() as session:
        row = platforms.get(session, platform_id)
        return () if row is None else platforms.view(row).origins
