"""The parser of authors' Markdown: CommonMark with tables, in which a formula between dollars stays as it is."""

import html
import re
from typing import Any

from markdown_it import MarkdownIt
from markdown_it.renderer import RendererHTML
from markdown_it.rules_inline import StateInline
from markdown_it.token import Token

from grader.domain.prose import DISPLAY, INLINE

TAG_LIKE = re.compile(r"<(?=[A-Za-z/!?])|&(?=#?\w+;)")
"""What a browser would take for a tag or a character reference."""


def make_parser(*, escapes_formulas: bool) -> MarkdownIt:
    """Returns a parser. With `escapes_formulas` every `<` and `&` of a formula is escaped, else only what a browser
    would take for markup: authors of JSON write `$h < 2I/c$`."""
    parser = MarkdownIt("commonmark", {"html": True}).enable("table")
    parser.inline.ruler.before("escape", "formula", _read_formula)
    parser.add_render_rule("formula", _render_formula if escapes_formulas else _render_raw_formula)
    parser.add_render_rule("text", _render_text)
    return parser


def _read_formula(state: StateInline, silent: bool) -> bool:
    """Takes a formula between dollars as it is: `_` and `*` in it are TeX."""
    if state.src[state.pos] != "$":
        return False
    match = DISPLAY.match(state.src, state.pos) or INLINE.match(state.src, state.pos)
    if match is None:
        return False
    if not silent:
        state.push("formula", "", 0).content = match[0]
    state.pos = match.end()
    return True


def _render_formula(_: RendererHTML, tokens: list[Token], index: int, *_rest: Any) -> str:
    return html.escape(tokens[index].content, quote=False)


def _render_raw_formula(_: RendererHTML, tokens: list[Token], index: int, *_rest: Any) -> str:
    return TAG_LIKE.sub(lambda found: html.escape(found[0]), tokens[index].content)


def _render_text(_: RendererHTML, tokens: list[Token], index: int, *_rest: Any) -> str:
    """A dollar that begins no formula stays one."""
    return html.escape(tokens[index].content, quote=False).replace("$", "&#36;")


def split_blocks(tokens: list[Token]) -> list[list[Token]]:
    """Returns the tokens of each block that is in no other."""
    blocks: list[list[Token]] = [[]]
    for token in tokens:
        blocks[-1].append(token)
        if token.level == 0 and token.nesting <= 0:
            blocks.append([])
    return blocks[:-1]
