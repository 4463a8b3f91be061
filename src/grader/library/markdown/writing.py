"""Writes a quiz as Markdown that reads back as the same. What has no form in Markdown stands in a fence of JSON."""

import html
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from html.parser import HTMLParser
from typing import Any

from grader.library.markdown.front_matter import write_front_matter
from grader.library.markdown.heading import write_heading
from grader.library.markdown.reading import infer_kind, read_markdown
from grader.library.markdown.slips import TEXTS

SHORT = ("id", "kind", "points", "attempts", "label", "reveal")
"""Keys that stand in the braces of a heading where their value is a text, a number or true or false."""

EXERCISE = ("takes", "entry", "starter", "check", "limits")
"""Keys of the fence ```exercise."""


MARKS = {"strong": "**", "em": "*", "code": "`"}
"""Elements that have a mark in Markdown."""

SPECIAL = re.compile(r"[\\`*\[\]~]|(?<![^\W_])_|_(?![^\W_])")
"""What would be markup in a line: an underscore at an end of a word, but none in it."""

WIDTH = 100
"""JSON that fits into a line of this length stands in one."""

FILE = "quizzes/written.md"

FOLLOWING_TEXT = "What follows."
FOLLOWING = f"##\n\n{FOLLOWING_TEXT}\n"
"""A question behind the one that is read back."""


def write_markdown(quiz: Mapping[str, Any]) -> str:
    """Returns the Markdown of a quiz, as it stands in its JSON. Raises ValueError for what no file can hold."""
    head = {name: value for name, value in quiz.items() if name not in ("questions", "labs")}
    parts = [write_front_matter(head).rstrip("\n")]
    parts += [write_lab(lab) for lab in quiz.get("labs", ())]
    parts += [write_question(question) for question in quiz.get("questions", ())]
    return "\n\n".join(parts) + "\n"


def write_lab(lab: Mapping[str, Any]) -> str:
    """Returns a lab of the quiz, which stands before the first question."""
    return _write_fence("lab", lab)


def write_question(question: Mapping[str, Any]) -> str:
    """Returns a question: each key in its own form if it reads back, else as JSON."""
    as_json: set[str] = set()
    while True:
        text = _write_form(question, as_json)
        read = _read_back(text)
        wrong = {name for name in question.keys() | read.keys() if question.get(name, ...) != read.get(name, ...)}
        wrong &= question.keys()
        if (read == question and read) or as_json == question.keys():
            return text
        as_json |= wrong or question.keys()


def _read_back(text: str) -> dict[str, Any]:
    """Returns the question that a text gives; nothing where it gives none, or takes in what follows it, as an element
    of HTML does that is not closed."""
    raw = read_markdown(f"\n{text}\n\n{FOLLOWING}", FILE).raw
    questions = raw.get("questions", []) if raw else []
    return dict(questions[0]) if len(questions) == 2 and questions[1].get("q") == FOLLOWING_TEXT else {}


def _write_form(question: Mapping[str, Any], as_json: set[str]) -> str:
    """Returns the Markdown of a question, the keys `as_json` in a fence."""
    own = {name: value for name, value in question.items() if name not in as_json}
    title = own.pop("title", "")
    short = {name: own.pop(name) for name in SHORT if isinstance(own.get(name), str | int | float | bool)}
    if short.get("kind") == infer_kind(own):
        del short["kind"]
    texts = {heading: own.pop(name) for heading, name in TEXTS.items() if isinstance(own.get(name), str)}
    parts = [write_heading(title if isinstance(title, str) else "", short)]
    if isinstance(own.get("q"), str):
        parts.append(write_text(own.pop("q")))
    parts += _write_parts(own, question)
    for fence, name in (("lab", "sim"), ("verify", "verify")):
        if isinstance(own.get(name), Mapping):
            parts.append(_write_fence(fence, own.pop(name)))
    exercise = {name: own.pop(name) for name in EXERCISE if name in own}
    rest = {**own, **{name: question[name] for name in question if name in as_json}}
    parts += [_write_fence(name, values) for name, values in (("exercise", exercise), ("question", rest)) if values]
    for heading, text in texts.items():
        parts += [f"### {heading}", write_text(text, wraps=TEXTS[heading] == "explain")]
    return "\n\n".join(filter(None, parts))


def _write_parts(own: dict[str, Any], question: Mapping[str, Any]) -> Iterator[str]:
    """Yields options, items, pairs or an answer, and takes their keys out of `own`."""
    kind = question.get("kind")
    if _are_texts(own.get("options")) and "answer" in own:
        options, answer = own.pop("options"), own.pop("answer")
        right = answer if isinstance(answer, list) else [answer]
        whys = own.pop("whys") if _are_texts(own.get("whys")) and len(own["whys"]) == len(options) else []
        lines = [f"- [{'x' if index in right else ' '}] {write_line(option)}" for index, option in enumerate(options)]
        quoted = [f"\n  > {write_line(why)}" for why in whys] or [""] * len(lines)
        yield "\n".join(line + why for line, why in zip(lines, quoted, strict=True))
    elif kind == "order" and _are_texts(own.get("items")):
        yield "\n".join(f"{index}. {write_line(item)}" for index, item in enumerate(own.pop("items"), 1))
    elif kind == "match" and isinstance(own.get("pairs"), list) and all(map(_are_texts, own["pairs"])):
        rows = [*own.pop("pairs"), *([["", right] for right in own.pop("extra", ())])]
        cells = [" | ".join(write_line(cell).replace("|", "\\|") for cell in row) for row in rows]
        yield "\n".join(["| | |", "|---|---|", *(f"| {row} |" for row in cells)])
    elif isinstance(own.get("answer"), int | float) and not isinstance(own["answer"], bool):
        words = ["Answer:", json.dumps(own.pop("answer"))]
        words += [own.pop("unit")] if isinstance(own.get("unit"), str) else []
        words += ["±", json.dumps(own.pop("tol"))] if own.get("tol") is not None else []
        yield " ".join(words)


def _are_texts(value: Any) -> bool:
    return isinstance(value, list) and all(isinstance(item, str) for item in value)


def _write_fence(name: str, value: Any) -> str:
    text = format_json(value)
    mark = choose_mark(text)
    return f"{mark}json {name}\n{text}\n{mark}"


def format_json(value: Any, indent: int = 0) -> str:
    """Returns JSON in which what fits into a line stands in one. Raises ValueError for a number that JSON has not."""
    line = json.dumps(value, ensure_ascii=False, allow_nan=False)
    if not value or not isinstance(value, dict | list) or indent + len(line) <= WIDTH:
        return line
    inner = " " * (indent + 1)
    if isinstance(value, list):
        rows = [format_json(item, indent + 1) for item in value]
    else:
        rows = [
            f"{json.dumps(name, ensure_ascii=False)}: {format_json(one, indent + 1)}" for name, one in value.items()
        ]
    ends = "[]" if isinstance(value, list) else "{}"
    return f"{ends[0]}\n{inner}" + f",\n{inner}".join(rows) + f"\n{' ' * indent}{ends[1]}"


def choose_mark(text: str) -> str:
    """Returns more backquotes than stand together anywhere in a text."""
    return "`" * max(3, 1 + max(map(len, re.findall("`+", text)), default=0))


def write_text(text: str, *, wraps: bool = False) -> str:
    """Returns the Markdown of an HTML text of a question: a line, or paragraphs, or the text as it is in a fence. With
    `wraps` a single paragraph stays one."""
    for form in (_write_paragraphs(text), "" if wraps else write_line(text), text):
        section = f"## T\n\n### Explanation\n\n{form}" if wraps else f"## T\n\n{form}"
        if form.strip() and _read_back(section).get("explain" if wraps else "q") == text:
            return form
    mark = choose_mark(text)
    return f"{mark}html text\n{text}\n{mark}"


def _write_paragraphs(text: str) -> str:
    """Returns a text of paragraphs as such; empty if it is none."""
    pieces = text.split("</p>")
    if pieces[-1] or not all(piece.startswith("<p>") for piece in pieces[:-1]):
        return ""
    return "\n\n".join(write_line(piece.removeprefix("<p>")) for piece in pieces[:-1])


class _Line(HTMLParser):
    """Writes the inline elements of an HTML text as Markdown; formulas, other tags and references as they are."""

    def __init__(self) -> None:
        super().__init__(convert_charrefs=False)
        self.parts: list[str] = []
        self.marks: list[str] = []

    def handle_starttag(self, tag: str, attrs: Sequence[tuple[str, str | None]]) -> None:
        marks = not attrs and tag in MARKS
        self.marks.append(MARKS[tag] if marks else "")
        self.parts.append(MARKS[tag] if marks else self.get_starttag_text() or "")

    def handle_endtag(self, tag: str) -> None:
        mark = self.marks.pop() if self.marks else ""
        self.parts.append(mark or f"</{tag}>")

    def handle_data(self, data: str) -> None:
        pieces = data.split("$")  # every second one is a formula
        if "`" not in self.marks:
            pieces = [piece if at % 2 else SPECIAL.sub(r"\\\g<0>", piece) for at, piece in enumerate(pieces)]
        self.parts.append("$".join(pieces))

    def handle_entityref(self, name: str) -> None:
        reference = f"&{name};"
        self.parts.append(html.unescape(reference) if "`" in self.marks else reference)

    def handle_charref(self, name: str) -> None:
        self.parts.append(f"&#{name};")


def write_line(text: str) -> str:
    """Returns an HTML text as a line of Markdown; empty for one that cannot be."""
    line = _Line()
    try:
        line.feed(text)
        line.close()
    except AssertionError:  # what `html.parser` raises for `<![`
        return ""
    return "".join(line.parts)
