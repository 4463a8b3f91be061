"""The parser of authors' Markdown: CommonMark with tables, in which a formula between dollars stays as it is."""

import html
import re
from typing import Any

from markdown_it import MarkdownIt
from markdown_it.renderer import RendererHTML
from markdown_it.rules_block import StateBlock
from markdown_it.rules_inline import StateInline
from markdown_it.token import Token
from markdown_it.utils import EnvType, OptionsDict

from grader.domain.pages.prose import DISPLAY, INLINE

BRACKETS = {r"\(": r"\)", r"\[": r"\]"}

DISPLAY_LINES_MAX = 100
"""Lines of one formula: its end is looked for no further."""

TAG_LIKE = re.compile(r"<(?=[A-Za-z/!?])|&(?=#?\w+;)")
"""What a browser would take for a tag or a character reference."""


def make_parser(*, of_lessons: bool) -> MarkdownIt:
    """Returns a parser. In lessons a formula also stands between `\\(` and `\\)`, or over several lines between `$$` or
    `\\[` and `\\]`, and every `<` and `&` of it is escaped. In quizzes `\\[` is a bracket, and only what a browser
    would take for markup is escaped: authors of JSON write `$h < 2I/c$`."""
    parser = MarkdownIt("commonmark", {"html": True}).enable("table")
    parser.inline.ruler.before("escape", "formula", _read_formula)
    if of_lessons:
        parser.inline.ruler.before("escape", "bracketed", _read_bracketed)
        parser.block.ruler.before(
            "fence", "display", _read_display, {"alt": ["paragraph", "reference", "blockquote", "list"]}
        )
    parser.add_render_rule("formula", _render_formula if of_lessons else _render_raw_formula)
    parser.add_render_rule("display", _render_display)
    parser.add_render_rule("image", _render_image)
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


def _read_bracketed(state: StateInline, silent: bool) -> bool:
    r"""Takes a formula between `\(` and `\)`, or `\[` and `\]`, as it is."""
    opening = state.src[state.pos : state.pos + 2]
    end = state.src.find(BRACKETS[opening], state.pos + 2) if opening in BRACKETS else -1
    tex = state.src[state.pos + 2 : end].strip()
    if end < 0 or not tex or "$" in tex:
        return False
    if not silent:
        dollars = "$" if opening == r"\(" else "$$"
        state.push("formula", "", 0).content = f"{dollars}{tex}{dollars}"
    state.pos = end + 2
    return True


def _read_display(state: StateBlock, start: int, end: int, silent: bool) -> bool:
    """Takes lines between `$$`, or `\\[` and `\\]`, as one formula: in a paragraph a line such as `= 2` would make a
    heading of it."""
    first = state.src[state.bMarks[start] + state.tShift[start] : state.eMarks[start]].rstrip()
    closing = {"$$": "$$", r"\[": r"\]"}.get(first[:2])
    if closing is None or state.is_code_block(start) or closing in first[2:]:
        return False
    lines = [first[2:]]
    for line in range(start + 1, min(end, start + DISPLAY_LINES_MAX)):
        text = state.src[state.bMarks[line] + state.tShift[line] : state.eMarks[line]].rstrip()
        if closing in text:
            break
        lines.append(text)
    else:
        return False
    tex = " ".join(filter(None, (*lines, text.removesuffix(closing)))).strip()
    if not tex or "$" in tex or not text.endswith(closing):
        return False
    if not silent:
        token = state.push("display", "", 0)
        token.content, token.map, token.block = tex, [start, line + 1], True
        state.line = line + 1
    return True


def _render_display(_: RendererHTML, tokens: list[Token], index: int, *_rest: Any) -> str:
    return f"<p>$${html.escape(tokens[index].content, quote=False)}$$</p>\n"


def _render_formula(_: RendererHTML, tokens: list[Token], index: int, *_rest: Any) -> str:
    return html.escape(tokens[index].content, quote=False)


def _render_raw_formula(_: RendererHTML, tokens: list[Token], index: int, *_rest: Any) -> str:
    return TAG_LIKE.sub(lambda match: html.escape(match[0]), tokens[index].content)


def _render_image(renderer: RendererHTML, tokens: list[Token], index: int, options: OptionsDict, env: EnvType) -> str:
    """A picture has no title, which no page shows; without a description no `alt`, as the check then names it."""
    tokens[index].attrs.pop("title", None)
    if tokens[index].content.strip():
        return renderer.image(tokens, index, options, env)
    tokens[index].attrs.pop("alt", None)
    return renderer.renderToken(tokens, index, options, env)


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
