"""Readable Markdown in place of what no page here runs: programs with their output, cases, foreign widgets."""

from collections.abc import Mapping
from typing import Any

from grader.domain.pages.markup import plain_text
from grader.library.markdown.writing import choose_mark

PROGRAM = ("code", "program", "input", "in")
PRINTED = ("output", "out", "stdout", "result")
"""Keys of an `io` block, and words after the fence of what a program printed."""

DIVIDER = "---"
"""The line between a program and its output in an `io` block that is no JSON."""


def write_fence(word: str, text: str) -> str:
    """Returns a fenced block."""
    body = text.strip("\n")
    mark = choose_mark(body)
    return f"{mark}{word}\n{body}\n{mark}"


def write_program(content: str, raw: Any) -> str:
    """Returns a program and what it prints, from the text of an `io` block, which is JSON (`raw`) or has a divider."""
    if isinstance(raw, Mapping):
        program = next((_as_text(raw[key]) for key in PROGRAM if key in raw), "")
        printed = next((_as_text(raw[key]) for key in PRINTED if key in raw), "")
    else:
        program, _, printed = f"\n{content}".partition(f"\n{DIVIDER}\n")
    parts = [("python", program), ("output", printed)]
    return "\n\n".join(write_fence(word, text) for word, text in parts if text.strip())


def write_case(raw: Mapping[str, Any]) -> str:
    """Returns the texts of a JSON object, each behind its key: a case to read, which asks nothing."""
    title = f"**{raw['title']}**" if isinstance(raw.get("title"), str) else ""
    rest = [(key, value) for key, value in raw.items() if key not in ("title", "id", "kind") and key[:2] != "x-"]
    return "\n\n".join(filter(None, (title, *(_write_part(key, value) for key, value in rest))))


def _write_part(key: str, value: Any) -> str:
    name = f"**{key[:1].upper()}{key[1:]}.**"
    if isinstance(value, list):
        return f"{name}\n\n" + "\n".join(f"- {_as_text(item)}" for item in value)
    text = _as_text(value)
    return f"{name}\n\n{write_fence('python', text)}" if "\n" in text and "<" not in text else f"{name} {text}"


def _as_text(value: Any) -> str:
    return "\n".join(map(str, value)) if isinstance(value, list) else str(value)


def write_widget(kind: str, title: str, source: str) -> str:
    """Returns the label of a widget that does not run here, which links to the original page where that is known."""
    name = "".join(character for character in plain_text(title or kind)[:100] if character not in "[]<>*_`\\")
    if source:
        return f"[{name} ({kind}): see it on the original page](<{source}>)"
    return f"{name} ({kind}): it does not run here."
