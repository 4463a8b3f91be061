"""Slips of authors who write Markdown: what would silently be a text that learners see, and was meant otherwise."""

import re
from collections.abc import Sequence
from difflib import get_close_matches

from markdown_it.token import Token

FENCES = ("lab", "exercise", "starter", "verify", "question", "text")
"""What fences are called that are no code of the text, behind the name of a language, if there is one."""

TEXTS = {"Explanation": "explain", "Reference": "reference"}
"""Headings of level 3, and the key of which the text follows."""

TASK = re.compile(r"\[([ xX])\](?:[ \t]+|$)")
ANSWER = re.compile(r"Answer:[ \t]*(.*)")

NEAR_TASK = re.compile(r"\[[ xX]?\](?![(\[:])")
TASK_LINE = re.compile(rf"(?m)^[ \t]*[-*+][ \t]+{NEAR_TASK.pattern}")
NEAR_ANSWER = re.compile(r"(?mi)^[*_]*answer[*_]*[ \t]*:")
COMMENT = re.compile(r"\s*<!--(?!.*<!--).*?-->\s*", re.DOTALL)
CELLS = re.compile(r"(?<!\\)\|")

HOW_TO_ANSWER = "write a paragraph of its own that begins with Answer:, such as Answer: 5 ms ± 0.05"
HOW_TO_MARK = "write - [x] or - [ ] at the margin, a blank, and the option"


def is_comment(token: Token) -> bool:
    """Whether a piece of HTML is a comment and nothing else."""
    return token.type in ("html_block", "html_inline") and COMMENT.fullmatch(token.content) is not None


def explain_slip(block: Sequence[Token], source: Sequence[str]) -> str:
    """Says what a block was meant to be that it is not: a heading, a fence, a table. Empty where it is well."""
    first = block[0]
    if first.type == "heading_open":
        return explain_heading(first, block[1].content)
    for token in block:
        if token.type == "fence" and (why := explain_fence(token, source)):
            return why
    return explain_table(block, source) if first.type == "table_open" else ""


def explain_heading(opening: Token, text: str) -> str:
    """Says what is wrong with a heading: an underlined one, and one that is nearly one of TEXTS."""
    if opening.markup in ("-", "="):
        return f"a line of {opening.markup} makes a heading of the text above it: leave an empty line between them"
    name = text.strip(" :*_#").casefold()
    near = get_close_matches(name, [heading.casefold() for heading in TEXTS], 1, 0.75)
    right = near[0].capitalize() if near else ""
    if right and (opening.tag, text) != ("h3", right):
        return f"the heading {text[:40]!r} begins no text of a question: write ### {right}"
    return ""


def explain_fence(token: Token, source: Sequence[str]) -> str:
    """Says what is wrong with a fence: one that never ends, and a word that is nearly one of FENCES."""
    begin, end = token.map or (0, 0)
    last = source[end - 1].strip(" \t>") if end <= len(source) else ""
    if token.map and (end - 1 <= begin or set(last) != set(token.markup) or len(last) < len(token.markup)):
        return f"this fence never ends: close it with {token.markup} in a line of its own"
    words = token.info.split()[:2]
    for word in words if not set(words) & set(FENCES) else ():
        if near := get_close_matches(word.casefold(), FENCES, 1, 0.8):
            return f"a fence {word[:40]!r} is shown as code: did you mean {near[0]}?"
    return ""


def explain_table(block: Sequence[Token], source: Sequence[str]) -> str:
    """Says which row has more cells than the head, which Markdown leaves out."""
    columns = sum(token.type == "th_open" for token in block)
    begin, end = block[0].map or (0, 0)
    for number in range(begin, min(end, len(source))):
        cells = CELLS.split(source[number].strip())
        count = len(cells) - (not cells[0].strip()) - (len(cells) > 1 and not cells[-1].strip())
        if count > columns:
            row = f"the row of the table in line {number + 1} has {count} cells, its head {columns}"
            return f"{row}: write \\| for a | in a cell"
    return ""


def explain_lost_part(block: Sequence[Token]) -> str:
    """Says what in a block of the question's text was meant to be its answer, or an option. Empty where nothing was."""
    for token in block:
        if token.type == "code_block" and TASK_LINE.search(token.content):
            return f"options that are indented by four blanks are code: {HOW_TO_MARK}"
        if token.type != "inline":
            continue
        if NEAR_ANSWER.search(token.content):
            return f"an answer stands in the text, which learners see: {HOW_TO_ANSWER}"
        if TASK_LINE.search(token.content) or (token.level == 3 and NEAR_TASK.match(token.content)):
            return f"an option stands in the text, which learners see: {HOW_TO_MARK}"
    return ""


def is_part(block: Sequence[Token]) -> bool:
    """Whether a block would be options or an answer in the text of a question."""
    content = [token.content for token in block if token.type == "inline"]
    is_answer = bool(content) and re.match(r"Answer:[ \t]*[-+\u2212]?\d", content[0]) is not None
    return is_answer or (block[0].type == "bullet_list_open" and any(map(TASK.match, content)))
