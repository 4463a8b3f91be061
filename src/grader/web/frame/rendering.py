"""Rendering of the templates, with the headers that every page has."""

import re
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import structlog
from fastapi import Request
from fastapi.responses import Response
from fastapi.templating import Jinja2Templates
from jinja2 import ChoiceLoader, FileSystemBytecodeCache, FileSystemLoader, FunctionLoader
from jinja2.bccache import Bucket
from jinja2.runtime import Macro

from grader import labs
from grader.domain.pages.markup import read_image, show_directions, spoken_text
from grader.gate.services import get_services
from grader.labs import lab_kinds
from grader.questions import installed_kinds, template_of
from grader.store import platforms
from grader.web.frame.assets import static
from grader.web.text import moments, numbers
from grader.web.text.prose import cached_prose
from grader.web.verdict import card

log = structlog.get_logger()

ROOM = Path(__file__).parents[1]

POLICY = "Content-Security-Policy"


def security_policy(framed_by: Iterable[str] = (), posts_to: Iterable[str] = ()) -> str:
    """Returns the security policy of a page that these origins may show in a frame, and whose forms may go to others.
    Scripts, styles and fonts come from files of this service only; authors may show pictures from other sites."""
    return (
        "default-src 'none'; script-src 'self'; style-src 'self'; font-src 'self'; img-src 'self' data: https:; "
        f"connect-src 'self'; form-action {join_sources(posts_to)}; base-uri 'none'; "
        f"frame-ancestors {join_sources(framed_by)}"
    )


def join_sources(origins: Iterable[str]) -> str:
    """Returns the service itself and these origins."""
    return " ".join(("'self'", *origins))


HEADERS = {
    POLICY: security_policy(),
    "Referrer-Policy": "same-origin",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "private, no-cache",
}
PRIVATE = {"Cache-Control": "no-store", "Referrer-Policy": "no-referrer"}
"""Headers of pages with a code: browsers do not store them, nor send their address to other sites."""


def load_kind_template(name: str) -> tuple[str, str, Callable[[], bool]] | None:
    """Loads the template of a kind of question, `kinds/KIND.html`, or lab, `labs/KIND.html`, which lies beside the
    kind's code: its text, its path, and whether the text is current, for Jinja2's FunctionLoader."""
    path = find_kind_template(name)
    return None if path is None else (path.read_text(encoding="utf-8"), str(path), lambda: True)


def find_kind_template(name: str) -> Path | None:
    """Returns where the template of an installed kind is; None for another name."""
    match = re.fullmatch(r"(kinds|labs)/(.+)\.html", name)
    if match is None:
        return None
    if match[1] == "labs":
        lab = lab_kinds().get(match[2])
        return None if lab is None else labs.template_of(lab)
    kind = installed_kinds().get(match[2])
    return None if kind is None else template_of(kind)


templates = Jinja2Templates(directory=ROOM / "templates")
templates.env.loader = ChoiceLoader([FileSystemLoader(ROOM / "templates"), FunctionLoader(load_kind_template)])
templates.env.trim_blocks = templates.env.lstrip_blocks = True
templates.env.globals["static"] = static
templates.env.filters |= {
    "clock": moments.tag_clock,
    "coded": numbers.mark_code,
    "fraction": numbers.write_fraction,
    "image": read_image,
    "lines_linked": card.link_lines,
    "moment": moments.tag_moment,
    "moments": moments.tag_moments,
    "number": numbers.write_number,
    "plain": "{:.12g}".format,
    "points": numbers.write_points,
    "prose": cached_prose,
    "remark": numbers.remark,
    "spoken": spoken_text,
    "typed": show_directions,
    "unbroken": numbers.keep_unbroken,
}


def show_or_say(macro: Macro, other: Macro, *arguments: Any) -> str:
    """Returns what a macro renders. Where it raises, as the template of a kind of another package may, the fault is
    logged, and `other` is rendered with the same arguments: the rest of the page is there all the same."""
    try:
        return macro(*arguments)
    except Exception:  # code of another package: anything may be raised
        log.exception("a template cannot be rendered", macro=macro.name)
        return other(*arguments)


templates.env.globals["show_or_say"] = show_or_say


class CompiledTemplates(FileSystemBytecodeCache):
    """Compiled templates in a folder, for the next start: to compile those of one page takes 50 ms, to read them 2."""

    def dump_bytecode(self, bucket: Bucket) -> None:
        """Writes a template; a full disk loses nothing but time."""
        with suppress(OSError):
            super().dump_bytecode(bucket)


def keep_compiled(folder: Path | None) -> None:
    """Keeps compiled templates in a folder, which must be private to the user; None keeps none."""
    templates.env.bytecode_cache = None if folder is None else CompiledTemplates(str(folder))


def page(
    request: Request, template: str, status: int = 200, more: Mapping[str, str] | None = None, **context: Any
) -> Response:
    """Renders a template, with the headers that every page has, and `more`. In a session that a learning platform
    launched, the platform may show the page in a frame."""
    headers = HEADERS | dict(more or {})
    who = getattr(request.state, "identity", None)
    if who is not None and who.platform is not None and POLICY not in (more or {}):
        headers[POLICY] = security_policy(list_origins(request, who.platform))
    return templates.TemplateResponse(request, template, context, status_code=status, headers=headers)


def list_origins(request: Request, platform_id: int) -> tuple[str, ...]:
    """Returns the origins whose pages may show ours in a frame; none once the platform is removed."""
    with get_services(request.app).database.read() as session:
        row = platforms.get(session, platform_id)
        return () if row is None else platforms.read_platform(row).origins
