"""Sphinx's configuration of the documentation site. The theme brings its scripts along, and uses the system's fonts."""

import re
import tomllib
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]

project = "MuJoCo grader"
author = "The authors of the MuJoCo grader"
release = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
extensions = ["myst_parser", "sphinx.ext.autodoc"]
root_doc = "index"
html_theme = "furo"
html_title = f"MuJoCo grader {release}"
html_copy_source = False
html_show_sphinx = False
myst_heading_anchors = 4
# A command with placeholders, or JSON with `...`, is shown without colours.
suppress_warnings = ["misc.highlighting_failure"]
autodoc_typehints = "signature"
autodoc_member_order = "bysource"

CODE = re.compile(r"(`+[^`]*`+)")
TREE = re.compile("[ │]*[├└]")


def mark_up(_app: Any, _what: str, _name: str, _object: Any, _options: Any, lines: list[str]) -> None:
    """Turns a docstring, which has `code` and plain text, into reStructuredText."""
    drawn = [number for number, line in enumerate(lines) if TREE.match(line)]
    for number, line in enumerate(lines):
        if number in drawn:
            lines[number] = f"   {line}"
            continue
        parts = CODE.split(line)
        parts[0::2] = [re.sub(r"([*_|\\])", r"\\\1", part) for part in parts[0::2]]
        parts[1::2] = [f"``{part.strip('`')}``" for part in parts[1::2]]
        lines[number] = "".join(parts)
    if drawn:
        lines[drawn[0] : drawn[0]] = ["", "::", ""]
        lines.insert(drawn[-1] + 4, "")


def setup(app: Any) -> None:
    """Registers what Sphinx calls."""
    app.connect("autodoc-process-docstring", mark_up)
