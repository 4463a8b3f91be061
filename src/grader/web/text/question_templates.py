"""Finds the template of a kind of question, which lies beside the kind's code."""

import re
from collections.abc import Callable

from grader.questions import installed_kinds, template_of

NAME = re.compile(r"kinds/(.+)\.html")


def template_name(kind: str) -> str:
    """The name of a kind's template for `import` in other templates: `kinds/mcq.html`."""
    return f"kinds/{kind}.html"


def load_template(name: str) -> tuple[str, str, Callable[[], bool]] | None:
    """The text of a kind's template, its path, and whether the text is current, for Jinja2's FunctionLoader."""
    found = NAME.fullmatch(name)
    kind = installed_kinds().get(found[1]) if found else None
    if kind is None:
        return None
    path = template_of(kind)
    return path.read_text(encoding="utf-8"), str(path), lambda: True
