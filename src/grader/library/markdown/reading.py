"""Reads a quiz in Markdown as the JSON of the same quiz. docs/markdown.md describes the form."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import PurePath
from typing import Any

from markdown_it.token import Token

from grader.errors import Fault
from grader.library.json_text import json_faults, parse_json
from grader.library.markdown.front_matter import read_front_matter, split_front_matter
from grader.library.markdown.heading import read_heading
from grader.library.markdown.parser import make_parser, split_blocks
from grader.library.markdown.slips import (
    ANSWER,
    FENCES,
    TASK,
    TEXTS,
    explain_lost_part,
    explain_slip,
    is_comment,
    is_part,
)
from grader.library.quiz_source import QuizSource

WRAPPED = {"explain"}
"""Texts of which a single paragraph stays one; others are the line in it."""

NUMBER = re.compile(r"[-+\u2212]?\d+(?:\.\d+)?(?:[eE][+-]?\d+)?")
TOLERANCE = re.compile(r"\s*(?:\u00b1|\+-|\+/-)\s*")

AFTER_NUMBER = re.compile(r"\s*[×·*^,]|\.\d|/\s*\d|\s+(?!1/)\d")
"""What behind a number shows that it goes on: a power, a comma, a fraction, digits behind a blank; `1/s` is a unit."""

PARSER = make_parser(of_lessons=False)


class _Refused(Exception):
    """What is wrong with a block, and the line if it is another one."""

    def __init__(self, why: str, line: int | None = None) -> None:
        super().__init__(why)
        self.line = line


@dataclass
class _Section:
    """A question that is being read: its key in faults, and the texts of which the blocks are collected."""

    key: str
    line: int
    values: dict[str, Any]
    texts: dict[str, list[tuple[str, bool]]] = field(default_factory=dict)
    target: str = "q"
    is_late: bool = False
    """Whether options or an answer stand below a heading of level 3, where they are text."""


@dataclass
class _Reading:
    file: str
    raw: dict[str, Any]
    faults: list[Fault] = field(default_factory=list)
    lines: dict[str, int] = field(default_factory=dict)
    starters: dict[str, str] = field(default_factory=dict)
    sections: list[_Section] = field(default_factory=list)
    labs: list[Any] = field(default_factory=list)
    env: dict[str, Any] = field(default_factory=dict)
    source: Sequence[str] = ()

    def fault(self, line: int, why: str) -> None:
        where = f"{self.sections[-1].key}, " if self.sections else ""
        self.faults.append(Fault(self.file, f"line {line}", f"{where}{why}"))

    def set(self, name: str, value: Any, line: int) -> None:
        """Sets a key of the question at hand."""
        section = self.sections[-1]
        if name in section.values:
            raise _Refused(f"{name} is given twice: keep one", line)
        section.values[name] = value
        self.lines.setdefault(f"{section.key}.{name}", line)


def read_markdown(text: str, file: str) -> QuizSource:
    """Returns the quiz of a file, or its faults, each with the line and the cure."""
    front, body = split_front_matter(text.replace("\r\n", "\n").replace("\r", "\n"))
    head = read_front_matter(front, file)
    if isinstance(head, Fault):
        return QuizSource(None, (head,))
    reading = _Reading(file, {"id": PurePath(file).stem, **head}, source=body.split("\n"))
    try:
        for block in split_blocks(PARSER.parse(body, reading.env)):
            line = (block[0].map or [0])[0] + 1
            try:
                _read_block(reading, block, line)
            except _Refused as refused:
                reading.fault(refused.line or line, str(refused))
    except RecursionError:
        reading.faults.append(Fault(file, "whole file", "lists or quotations are nested too deeply"))
    for name, what in (("questions", "begin each with ##"), ("labs", "write each in a fence ```lab")):
        if name in head:
            reading.faults.append(Fault(file, "line 1", f"front matter: {name} stand below it: {what}"))
    if reading.labs:
        reading.raw["labs"] = reading.labs
    if reading.sections:
        reading.raw["questions"] = [_finish(reading, section) for section in reading.sections]
    questions = tuple((section.key, section.line) for section in reading.sections)
    raw = None if reading.faults else reading.raw
    return QuizSource(raw, tuple(sorted(reading.faults)), reading.lines, questions, reading.starters)


def _read_block(reading: _Reading, block: list[Token], line: int) -> None:
    """Reads one block. Raises _Refused."""
    first = block[0]
    if why := explain_slip(block, reading.source):
        raise _Refused(why)
    if is_comment(first):  # it is the author's own
        return
    if first.type == "heading_open" and first.tag == "h2":
        _begin_question(reading, block[1].content, line)
        return
    if first.type == "fence" and (name := _fence_name(first.info)) is not None:
        _read_fence(reading, name, first, line)
        return
    if not reading.sections:
        raise _Refused("a text before the first question: the title is in the front matter, a question begins with ##")
    section = reading.sections[-1]
    if first.type == "heading_open" and first.tag == "h3" and block[1].content in TEXTS:
        section.target = TEXTS[block[1].content]
        if section.target in section.texts:
            raise _Refused(f"{block[1].content} occurs more than once: keep one")
        reading.lines.setdefault(f"{section.key}.{section.target}", line)
        section.texts[section.target] = []
    elif section.target != "q" or not _read_part(reading, block, line):
        if section.target == "q" and (why := explain_lost_part(block)):
            raise _Refused(why)
        section.is_late |= section.target != "q" and is_part(block)
        _read_prose(reading, block)


def _read_part(reading: _Reading, block: list[Token], line: int) -> bool:
    """Reads a block that is no text of the question but a part of it; returns whether it is one. Raises _Refused."""
    first, kind = block[0].type, reading.sections[-1].values.get("kind")
    if first == "bullet_list_open" and _list_marks(block):
        _read_options(reading, block, line)
    elif first == "paragraph_open" and (match := ANSWER.match(block[1].content)):
        _read_answer(reading, block[1].content[match.start(1) :], line)
    elif first == "ordered_list_open" and kind == "order":
        reading.set("items", [_read_item(reading, item)[0] for item in _split_items(block)], line)
    elif first == "table_open" and kind == "match":
        _read_pairs(reading, block, line)
    else:
        return False
    return True


def _read_prose(reading: _Reading, block: list[Token]) -> None:
    """Adds a block to the text at hand."""
    section = reading.sections[-1]
    for token in block:
        token.info = ""  # the language of code would become a class, which no page keeps
        token.attrs.pop("style", None)  # nor the alignment of a column
        token.children = [child for child in token.children or () if not is_comment(child)]
    is_line = block[0].type == "paragraph_open"
    tokens = block[1:-1] if is_line else block
    markup = PARSER.renderer.render(tokens, PARSER.options, reading.env).removesuffix("\n")
    section.texts.setdefault(section.target, []).append((markup, is_line))


def _begin_question(reading: _Reading, heading: str, line: int) -> None:
    position = len(reading.sections) + 1
    try:
        values = read_heading(heading)
    except ValueError as error:
        reading.sections.append(_Section(f"q{position}", line, {}))
        raise _Refused(str(error)) from error
    key = values["id"] if isinstance(values.get("id"), str) else f"q{position}"
    reading.sections.append(_Section(key, line, values))
    reading.lines.setdefault(key, line)


def _fence_name(info: str) -> str | None:
    """Returns which of FENCES a fence is, if it is one: its first word, or the one behind a language."""
    words = info.split()[:2]
    return next((word for word in words if word in FENCES), None)


def _read_fence(reading: _Reading, name: str, token: Token, line: int) -> None:
    """Reads a fence of JSON, of a starter, or of a text that is taken as it is. Raises _Refused."""
    if not reading.sections and name != "lab":
        raise _Refused(f"{name} belongs to a question: begin one with ## above it")
    if name == "text":
        section = reading.sections[-1]
        section.texts.setdefault(section.target, []).append((token.content.removesuffix("\n"), False))
        return
    if name == "starter":
        suffix = ".xml" if token.info.split()[0] == "xml" else ".py"
        path = f"{reading.file}#{reading.sections[-1].key}{suffix}"
        reading.set("starter", path, line)
        reading.starters[path] = token.content
        return
    raw = parse_json("\n" * line + token.content, reading.file)
    if isinstance(raw, Fault):
        reading.faults.append(raw)
        return
    for fault in json_faults(raw, reading.file, ""):
        reading.fault(line, f"{fault.key}: {fault.why}")
    if not isinstance(raw, dict):
        raise _Refused(f'{name} must be one JSON object: {{"key": value}}')
    if name == "lab" and not reading.sections:
        reading.lines.setdefault(str(raw.get("id", f"labs.{len(reading.labs)}")), line)
        reading.labs.append(raw)
    elif name in ("lab", "verify"):
        reading.set("sim" if name == "lab" else name, raw, line)
    else:
        for key, value in raw.items():
            reading.set(key, value, line)


def _list_marks(block: list[Token]) -> bool:
    """Whether a list is one of options: an item begins with [ ] or [x]."""
    return any(TASK.match(token.content) for token in block if token.type == "inline" and token.level == 3)


def _split_items(block: list[Token]) -> list[list[Token]]:
    """Returns what stands in each item of a list."""
    items: list[list[Token]] = []
    for token in block[1:-1]:
        if token.type == "list_item_open" and token.level == 1:
            items.append([])
        elif not (token.type == "list_item_close" and token.level == 1):
            items[-1].append(token)
    return items


def _read_options(reading: _Reading, block: list[Token], line: int) -> None:
    """Reads options with their marks, and a sentence on each. Raises _Refused."""
    options, whys, right = [], [], []
    for index, item in enumerate(_split_items(block)):
        inline = item[1] if len(item) > 1 and item[1].type == "inline" else None
        at = (inline.map or [line - 1])[0] + 1 if inline else line
        mark = TASK.match(inline.content) if inline else None
        if mark is None:
            raise _Refused(f"option {index + 1} has no mark: begin it with [ ] or, if it is right, [x]", at)
        option, why = _read_item(reading, item, mark.end(), at)
        if not option:
            raise _Refused(f"option {index + 1} is empty: write its text behind the mark", at)
        options.append(option)
        whys.append(why)
        right += [index] if mark[1] != " " else []
        reading.lines.setdefault(f"{reading.sections[-1].key}.options.{index}", at)
    if not right:
        raise _Refused("no option is right: mark one with [x]")
    reading.set("options", options, line)
    if any(why is not None for why in whys):
        missing = next((index for index, why in enumerate(whys, 1) if why is None), None)
        if missing is not None:
            raise _Refused(f"option {missing} has no sentence on it: write > and why below it, as below the others")
        reading.set("whys", whys, line)
    kind = reading.sections[-1].values.get("kind")
    several = len(right) > 1 if kind is None else kind == "multiple"
    if not several and len(right) > 1:
        raise _Refused(
            f"options {', '.join(str(index + 1) for index in right)} are marked: {kind} has one right option"
        )
    reading.set("answer", right if several else right[0], line)


def _read_item(reading: _Reading, item: list[Token], skip: int = 0, line: int | None = None) -> tuple[str, str | None]:
    """Returns the line of an item, and the quotation below it. Raises _Refused for anything else in it."""
    if len(item) < 3 or item[0].type != "paragraph_open":
        raise _Refused("an item must be a line of text", line)
    option = PARSER.renderInline(item[1].content[skip:].strip(), reading.env)
    rest = split_blocks([_lift(token, item[0].level) for token in item[3:]])
    if not rest:
        return option, None
    if len(rest) > 1 or rest[0][0].type != "blockquote_open":
        raise _Refused("below an item may stand one quotation alone: > and why", line)
    inside = rest[0][1:-1]
    is_line = len(inside) == 3 and inside[0].type == "paragraph_open"
    why = PARSER.renderer.render(inside[1:-1] if is_line else inside, PARSER.options, reading.env)
    return option, why.removesuffix("\n")


def _lift(token: Token, level: int) -> Token:
    """Returns a token of a list as it would be outside of it."""
    token.level -= level
    return token


def _read_answer(reading: _Reading, text: str, line: int) -> None:
    """Reads a number with its unit and tolerance. Raises _Refused."""
    cure = "write such as Answer: 5 ms ± 0.05"
    if "\n" in text:
        raise _Refused(f"the answer goes on in the next line: leave an empty line below it, and {cure}")
    value, *tolerances = TOLERANCE.split(text.strip())
    match = NUMBER.match(value)
    if match is None or AFTER_NUMBER.match(value, match.end()) or len(tolerances) > 1:
        raise _Refused(f"{text.strip()[:40]!r} is no number with a unit and a tolerance: {cure}")
    reading.set("answer", _parse_number(match[0]), line)
    if unit := value[match.end() :].strip():
        reading.set("unit", unit, line)
    for tolerance in tolerances:
        whole = NUMBER.fullmatch(tolerance.strip())
        if whole is None:
            raise _Refused(
                f"{tolerance.strip()[:40]!r} is no tolerance, which is a number in the unit of the answer: {cure}"
            )
        reading.set("tol", _parse_number(whole[0]), line)


def _parse_number(text: str) -> int | float:
    text = text.replace("\u2212", "-").removeprefix("+")
    return float(text) if set(text) & set(".eE") or len(text) > 15 else int(text)


def _read_pairs(reading: _Reading, block: list[Token], line: int) -> None:
    """Reads a table of pairs; a right text without a left one is `extra`. Raises _Refused."""
    rows: list[list[str]] = []
    for token in block:
        if token.type == "tr_open":
            rows.append([])
        elif token.type == "inline":
            rows[-1].append(PARSER.renderInline(token.content, reading.env))
    if any(len(row) != 2 for row in rows):
        raise _Refused("the table of pairs must have two columns: | left | right |")
    pairs = [row for row in rows[1:] if row[0]]
    extra = [row[1] for row in rows[1:] if not row[0]]
    reading.set("pairs", pairs, line)
    if extra:
        reading.set("extra", extra, line)


def _finish(reading: _Reading, section: _Section) -> dict[str, Any]:
    """Returns a question with its texts and, where none is given, its kind."""
    values = section.values
    for name, parts in section.texts.items():
        is_line = len(parts) == 1 and parts[0][1]
        if name in values:
            reading.faults.append(Fault(reading.file, f"line {section.line}", f"{section.key}, {name} is given twice"))
        wraps = name in WRAPPED or not is_line
        values[name] = "".join(f"<p>{part}</p>" if wraps and line else part for part, line in parts)
    values.setdefault("kind", infer_kind(values))
    if section.is_late and values["kind"] == "open":
        why = "its options or its answer stand below ### Explanation or ### Reference: move them above"
        reading.faults.append(Fault(reading.file, f"line {section.line}", f"{section.key}, {why}"))
    return values


def infer_kind(values: Mapping[str, Any]) -> str:
    """Returns the kind of a question by what it has."""
    if "options" in values:
        several = isinstance(values.get("answer"), list)
        return "multiple" if several else "predict" if "sim" in values else "mcq"
    return "code" if "check" in values else "numeric" if "answer" in values else "open"
