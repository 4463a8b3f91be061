"""Converts HTML to plain text, and quotes what was typed."""

import html
import re

import nh3

LONE_BRACKET = re.compile(r"<(?!/?[A-Za-z][^<>$]*>|!--)")
"""A `<` that opens no tag. A tag holds no dollar sign: `$a<b$ and $c>d$` is TeX."""


def plain_text(markup: str) -> str:
    """Strip the tags of an HTML fragment, decode its entities and collapse white space; TeX stays as typed. Parses the
    fragment as HTML5, in time quadratic in the depth of its nesting. Half a surrogate pair becomes a question mark."""
    fragment = LONE_BRACKET.sub("&lt;", markup).encode(errors="replace").decode()
    return " ".join(html.unescape(nh3.clean(fragment, tags=set(), link_rel=None)).split())


def quoted(text: str) -> str:
    """Quote what a student typed, printable and short enough to repeat in a sentence."""
    clean = "".join(c if c.isprintable() else " " for c in text[:200]).strip()
    return f'"{clean[:40]}…"' if len(clean) > 40 else f'"{clean}"'
