"""Converts the file of a quiz between JSON and Markdown, without loss."""

import json
from pathlib import Path
from typing import Any

from grader.errors import Conflict, ContentError, Fault
from grader.library.files import QUIZ_BYTES_MAX, read_text
from grader.library.markdown import write_markdown
from grader.library.quiz_files import MARKDOWN, is_markdown, parse_quiz


def convert_file(path: Path) -> dict[Path, str]:
    """Returns the texts that say the same in the other form, by path: the quiz beside its file, and starters that stood
    in Markdown, in `starters/`. Raises ContentError."""
    text = read_text(path.parent, path.name, QUIZ_BYTES_MAX)
    if isinstance(text, Fault):
        raise ContentError([text])
    source = parse_quiz(text, path.name)
    if source.faults:
        raise ContentError(source.faults)
    if not isinstance(source.raw, dict) or "id" not in source.raw:
        raise ContentError([Fault(path.name, "whole file", "is no quiz: it has no id")])
    if not is_markdown(path.name):
        return {path.with_suffix(MARKDOWN): write_markdown(source.raw)}
    own: dict[str, str] = {}
    for question in source.raw.get("questions", ()):
        if (name := question.get("starter")) in source.starters:
            file = f"starters/{path.stem}-{name.rpartition('#')[2]}"
            own[file] = source.starters[name]
            question["starter"] = f"{path.parent.name}/{file}"
    return {path.with_suffix(".json"): dump_quiz(source.raw), **{path.parent / name: own[name] for name in own}}


def dump_quiz(raw: dict[str, Any]) -> str:
    """Returns a quiz as the text of its JSON."""
    return json.dumps(raw, ensure_ascii=False, indent=2) + "\n"


def write_converted(path: Path) -> list[Path]:
    """Writes the other form of a quiz beside its file, which gets a ~ at its end, so that the quiz is there once.
    Returns what was written. Raises ContentError, and Conflict where a file is there already."""
    texts = convert_file(path)
    backup = path.with_name(f"{path.name}~")
    if there := next((path for path in (*texts, backup) if path.exists()), None):
        raise Conflict(f"{there} is there already: rename it first")
    for place, text in texts.items():
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_text(text, encoding="utf-8")
    path.rename(backup)
    return [*texts]
