"""Remarks on authors' texts: what a page does not show as it was meant, such as a formula that is not TeX."""

import html
import re
import unicodedata
from collections.abc import Iterator, Mapping, Sequence
from difflib import get_close_matches
from functools import cache

from grader.domain.pages.markup import quoted
from grader.domain.pages.media import ADDRESS
from grader.domain.pages.prose import (
    ALIASES,
    COMMENT_END,
    DISPLAY,
    HTML_ATTRIBUTES,
    HTML_TAGS,
    INLINE,
    MATHML_TAGS,
    TOKEN,
    VERBATIM,
    convert_tex,
)

VOID = frozenset(("br", "hr", "img"))

OPTIONAL_END = frozenset(("p", "li", "dt", "dd", "tr", "td", "th", "tbody", "thead"))
"""Elements whose end tag HTML lets an author leave out."""

COMMON_TAGS = ("b", "code", "em", "li", "ol", "p", "pre", "table", "ul")

ATTRIBUTE = re.compile(r"""\s([A-Za-z-]+)\s*=\s*(?:"([^"]*)"|'([^']*)'|([^\s"'>]+))""")

ENVIRONMENT = re.compile(r"\\(begin|end)\s*\{([^{}]*)\}")
UNREAD_COMMAND = re.compile(r"\\[A-Za-z]+")
ESCAPED = re.compile(r"\\[{}\\]")
DOLLAR = re.compile(r"(?<!\\)\$")

MARKDOWN = (
    (re.compile(r"(?<![\w*])\*\*(?=\S)([^*\n]+?)(?<=\S)\*\*(?![\w*])"), "<b>", "</b>"),
    (re.compile(r"(?<![\w_])__(?=\S)([^_\n]+?)(?<=\S)__(?![\w_])"), "<b>", "</b>"),
    (re.compile(r"```[a-z]*\n?(.*?)```", re.DOTALL), "<pre>", "</pre>"),
    (re.compile(r"(?<!`)`([^`\n]+)`(?!`)"), "<code>", "</code>"),
)
MARKDOWN_LINK = re.compile(r"!?\[([^\]\n]+)\]\(([^\s()]+)\)")
MARKDOWN_LINE = re.compile(r"^(#{1,6} |[-*] )\S", re.MULTILINE)


def list_prose_remarks(text: str) -> Iterator[str]:
    """Yields what is wrong with a text of HTML and TeX, each with its cure."""
    if len(DOLLAR.findall(text)) % 2:
        yield "an odd number of $ signs: TeX stands between two; write \\$ for a dollar"
    pieces = list(_scan(text))
    for sort, piece in pieces:
        if sort == "formula" and (why := explain_tex(html.unescape(piece))):
            yield f"the formula {quoted(f'${piece}$')} is not shown as it was meant: {why}"
    yield from _list_tag_remarks([piece for sort, piece in pieces if sort == "tag"])
    yield from _list_markdown_remarks("".join(piece for sort, piece in pieces if sort == "text"))


def _scan(text: str) -> Iterator[tuple[str, str]]:
    """Yields the TeX of each `formula`, each `tag` and each `text` between them, as a page reads them. What stands in
    code is left out."""
    position = verbatim_until = 0
    while token := TOKEN.search(text, position):
        start, name = token.start(), (token["name"] or "").lower()
        if position >= verbatim_until:
            yield "text", text[position:start]
        position = token.end()
        if name:
            yield "tag", token[0]
            if name in VERBATIM and token[0][1] != "/" and start >= verbatim_until:
                end = VERBATIM[name].search(text, position)
                verbatim_until = end.start() if end else position
        elif token[0] == "<!--":
            end = COMMENT_END.search(text, position)
            position = end.end() if end else position
        elif start < verbatim_until:
            continue
        elif token[0] == "$" and (formula := DISPLAY.match(text, start) or INLINE.match(text, start)):
            yield "formula", formula[1]
            position = formula.end()
        else:
            yield "text", token[0]
    yield "text", text[position:]


def explain_tex(tex: str) -> str | None:
    """Returns why a formula is not shown as it was meant, with the cure; None where it is."""
    braces = ESCAPED.sub("", tex)
    if braces.count("{") != braces.count("}"):
        side, other = "{}" if braces.count("{") > braces.count("}") else "}{"
        return f"a {side} has no {other}: add it"
    if why := _explain_environments(tex):
        return why
    try:
        tree = convert_tex(tex)
    except Exception:  # its errors have no common class
        return "this TeX cannot be read: see whether a command lacks its arguments, or \\left its \\right"
    for element in tree.iter():
        if unread := UNREAD_COMMAND.fullmatch((element.text or "").strip()):
            near = get_close_matches(unread[0], _list_commands(), n=1)
            meant = f"did you mean {near[0]}?" if near else "write it with other commands"
            return f"the command {unread[0]} is not known: {meant}"
    return None


def _explain_environments(tex: str) -> str | None:
    """Returns what is wrong with the environments of a formula: the library shows the parts of one that it does not
    know in a row, `&` and all."""
    from latex2mathml import commands

    known = {name.removeprefix("\\") for name in commands.MATRICES} | ALIASES.keys()
    begun, ended = ([match[2] for match in ENVIRONMENT.finditer(tex) if match[1] == word] for word in ("begin", "end"))
    for name in begun:
        if name not in known:
            near = get_close_matches(name, known, n=1)
            meant = f"did you mean {near[0]}?" if near else "write it with aligned, cases or matrix"
            return f"the environment {name[:40]!r} is not known: {meant}"
    if sorted(begun) != sorted(ended):
        return "a \\begin has no \\end of the same name, or the other way round: add it"
    return None


@cache
def _list_commands() -> list[str]:
    """Returns the commands of TeX that are understood and the names of Greek letters, for what was misspelt."""
    from latex2mathml import commands

    named = [value for value in vars(commands).values() if isinstance(value, str)]
    letters = [unicodedata.name(chr(code)).split()[-1].lower() for code in range(0x3B1, 0x3CA) if code != 0x3C2]
    return sorted(
        {command for command in named if UNREAD_COMMAND.fullmatch(command)} | {f"\\{letter}" for letter in letters}
    )


def _list_tag_remarks(tags: Sequence[str]) -> Iterator[str]:
    """Yields a remark for each tag that a page leaves out, or that is not closed, and each picture without a file."""
    opened: list[str] = []
    for tag in tags:
        name = tag.strip("</>").split()[0].rstrip("/").lower()
        if name not in HTML_TAGS | MATHML_TAGS:
            if not tag.startswith("</"):
                yield f"{tag[:60]} is not shown: {_suggest_tag(name)}"
        elif tag.startswith("</"):
            yield from _close(name, opened)
        else:
            yield from _list_attribute_remarks(name, tag)
            if name not in VOID and not tag.endswith("/>"):
                opened.append(name)
    yield from (f"<{name}> is not closed: add </{name}>" for name in opened if name not in OPTIONAL_END)


def _suggest_tag(name: str) -> str:
    near = get_close_matches(name, sorted(HTML_TAGS), n=1)
    return f"did you mean <{near[0]}>?" if near else f"texts may use {', '.join(COMMON_TAGS)} and some other tags"


def _close(name: str, opened: list[str]) -> Iterator[str]:
    """Takes an element from those that are open, and yields what is wrong with its end tag."""
    if name not in opened:
        yield f"</{name}> closes nothing: remove it, or open <{name}> before"
        return
    while (inner := opened.pop()) != name:
        if inner not in OPTIONAL_END:
            yield f"<{inner}> is not closed: add </{inner}> before </{name}>"


def _list_attribute_remarks(name: str, tag: str) -> Iterator[str]:
    attributes = {match[1].lower(): next(filter(None, match.groups()[1:]), "") for match in ATTRIBUTE.finditer(tag)}
    if name == "img":
        yield from _list_picture_remarks(attributes)
    if name in HTML_TAGS:
        for attribute in sorted(attributes.keys() - HTML_ATTRIBUTES.get(name, set())):
            yield f"the attribute {attribute} of {tag[:60]} is not shown: remove it"


def _list_picture_remarks(attributes: Mapping[str, str]) -> Iterator[str]:
    """Yields what is wrong with a picture. Those of the content folder have their served addresses by now."""
    address = attributes.get("src", "")
    if not address.startswith(("https://", ADDRESS)):
        cure = "put the file into images/ of the content folder, or give an address (https://...)"
        yield f"the picture {quoted(address)} is not there: {cure}"
    if "alt" not in attributes:
        cure = 'add alt="what it shows", or alt="" where it only adorns'
        yield f"the picture {quoted(address.rpartition('/')[2])} has no description: {cure}"


def _list_markdown_remarks(plain: str) -> Iterator[str]:
    """Yields a remark for each sort of Markdown in a text without tags, formulas and code."""
    for pattern, opening, closing in MARKDOWN:
        if match := pattern.search(plain):
            yield f"{quoted(match[0])} is Markdown, which is shown as typed: write {opening}{match[1]}{closing}"
    if match := MARKDOWN_LINK.search(plain):
        picture, link = f'<img src="{match[2]}" alt="{match[1]}">', f'<a href="{match[2]}">{match[1]}</a>'
        cure = picture if match[0][0] == "!" else link
        yield f"{quoted(match[0])} is Markdown, which is shown as typed: write {cure}"
    if match := MARKDOWN_LINE.search(plain):
        tags = "<h3>...</h3>" if match[1].startswith("#") else "<ul><li>...</li></ul>"
        yield f"a line that begins with {match[1].strip()} is Markdown, which is shown as typed: write {tags}"
