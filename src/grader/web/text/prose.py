"""Turns authors' HTML with TeX between dollars into safe HTML with MathML, in time linear in its length."""

import html
import re
from collections.abc import Iterator
from functools import lru_cache

import nh3
from markupsafe import Markup

from grader.domain.pages.prose import (
    ATTRIBUTES,
    COMMENT_END,
    DISPLAY,
    HTML_TAGS,
    INLINE,
    MATHML_TAGS,
    TOKEN,
    URL_SCHEMES,
    VERBATIM,
    render_tex,
)
from grader.web.text.numbers import join_units

TAGS_MAX = 2000
"""Tags of one text; further ones are shown as typed. The time of the HTML5 algorithm is quadratic in their nesting."""

TEX_LENGTH_MAX = 2000
TEX_BUDGET = 10_000
"""Characters of TeX in one text, which take about 20 us each to convert; further formulas are shown as typed."""

FORMULA_COST = 10
"""The part of the budget that a formula takes besides its length."""

_CLEANER = nh3.Cleaner(
    tags=set(HTML_TAGS | MATHML_TAGS),
    attributes=ATTRIBUTES,
    url_schemes=set(URL_SCHEMES),
    link_rel="noopener noreferrer",
)


def safe_html(prose: str) -> Markup:
    """Converts TeX to MathML, keeps numbers and units together, and removes all that could run or load code.

    Text inside code, pre, kbd and samp stays as it is; `\\$` is a dollar sign.
    """
    clean = _CLEANER.clean("".join(_Reader(prose).pieces()))  # sanitised last: MathML is no safer than its TeX
    return Markup(clean)  # noqa: S704


@lru_cache(maxsize=4096)
def cached_prose(prose: str) -> Markup:
    """`safe_html` of an author's text, which many pages show."""
    return safe_html(prose)


class _Reader:
    """Reads a text once, from left to right. A search that found nothing is not repeated."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.tags, self.tex = TAGS_MAX, TEX_BUDGET
        self.absent: set[str] = set()

    def pieces(self) -> Iterator[str]:
        """HTML with MathML, not yet sanitised. Numbers in the text, formulas too, keep their units on the same line."""
        position = verbatim_until = number_until = 0
        while token := TOKEN.search(self.text, position):
            start, piece = token.start(), token[0]
            text = self.text[position:start]
            yield text if position < verbatim_until else join_units(text, is_after_number=0 < position == number_until)
            position = token.end()
            if name := token["name"]:
                yield self._tag(piece, name)
                if start >= verbatim_until and name.lower() in VERBATIM and piece[1] != "/":
                    verbatim_until = self._end_of(VERBATIM[name.lower()], position) or position
            elif piece == "<!--":
                end = self._end_of(COMMENT_END, position)
                yield "" if end else "&lt;!--"
                position = end or position
            elif piece == "<":
                yield "&lt;"
            elif start < verbatim_until:
                yield piece
            elif piece == "$" and (formula := DISPLAY.match(self.text, start) or INLINE.match(self.text, start)):
                yield self._mathml(formula)
                position = formula.end()
                number_until = position if formula[1].rstrip("}")[-1:].isdigit() else 0
            else:
                yield "$"
        yield join_units(self.text[position:], is_after_number=0 < position == number_until)

    def _end_of(self, pattern: re.Pattern[str], position: int) -> int | None:
        """Says where the next match of `pattern` ends."""
        if pattern.pattern in self.absent:
            return None
        if match := pattern.search(self.text, position):
            return match.end()
        self.absent.add(pattern.pattern)
        return None

    def _tag(self, tag: str, name: str) -> str:
        """Returns the tag without the attributes that are removed later: HTML5 repeats unclosed elements with them."""
        self.tags -= 1
        if self.tags < 0:
            return html.escape(tag)
        if tag[1] == "/":
            return f"</{name}>"
        if name.lower() in ATTRIBUTES:
            return tag
        return f"<{name}/>" if tag.endswith("/>") else f"<{name}>"

    def _mathml(self, formula: re.Match[str]) -> str:
        """Returns a formula as MathML, or as it was typed if it is too long or the budget is spent."""
        tex = formula[1]
        self.tex -= len(tex) + FORMULA_COST
        if len(tex) > TEX_LENGTH_MAX or self.tex < 0:
            return f"<code>{tex.replace('<', '&lt;')}</code>"
        return render_tex(html.unescape(tex), "block" if formula.re is DISPLAY else "inline")
