"""The files of quizzes: JSON, and Markdown that stands for it."""

import re
from collections.abc import Container, Iterable
from pathlib import Path

from grader.errors import Fault
from grader.library.files import QUIZ_BYTES_MAX, list_files, read_text
from grader.library.json_text import parse_json
from grader.library.quiz_source import QuizSource

MARKDOWN = ".md"
ID = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")
"""What `Quiz` and `Question` take."""

NOT_QUIZZES = ("readme.md",)


def list_quiz_files(root: Path) -> list[str]:
    """Returns the files of quizzes, sorted by name. A README is none."""
    names = [*list_files(root, "quizzes", "*.json"), *list_files(root, "quizzes", f"*{MARKDOWN}")]
    return sorted(name for name in names if Path(name).name.lower() not in NOT_QUIZZES)


def parse_quiz(text: str, file: str) -> QuizSource:
    """Returns what the text of a file says: JSON, or Markdown by the ending of its name."""
    if is_markdown(file):
        from grader.library.markdown import read_markdown  # takes longer to import than JSON to be read

        return read_markdown(text, file)
    raw = parse_json(text, file)
    return QuizSource(None, (raw,)) if isinstance(raw, Fault) else QuizSource(raw)


def is_markdown(file: str) -> bool:
    """Whether a file is Markdown, by its name."""
    return file.endswith(MARKDOWN)


def outline_quiz(root: Path, file: str) -> tuple[str, dict[str, str]] | None:
    """Returns the id of a quiz and those of its questions by their names, also where they have faults; None for what is
    no quiz."""
    text = read_text(root, file, QUIZ_BYTES_MAX)
    if isinstance(text, Fault):
        return None
    source = parse_quiz(text, file)
    if is_markdown(file):
        named = source.raw["id"] if source.raw is not None else Path(file).stem
        return str(named), name_questions(enumerate((id_ for id_, _ in source.questions), 1))
    if not isinstance(source.raw, dict) or not isinstance(source.raw.get("id"), str):
        return None
    items = source.raw.get("questions")
    numbered = enumerate(items if isinstance(items, list) else [], 1)
    ids = ((number, str(item.get("id", f"q{number}"))) for number, item in numbered if isinstance(item, dict))
    return source.raw["id"], name_questions(ids)


def name_questions(ids: Iterable[tuple[int, str]]) -> dict[str, str]:
    """Returns ids by their names, of places from 1 on in a quiz and the ids there."""
    named: dict[str, str] = {}
    for number, id_ in ids:
        named[name_question(number, id_, named)] = id_
    return named


def name_question(number: int, id_: str, taken: Container[str]) -> str:
    """Returns the name by which a question is found, in an address too: its id, or its place, as `~3`, where that is
    no valid id or one of those before it has `taken` it."""
    return id_ if ID.fullmatch(id_) and id_ not in taken else f"~{number}"


def name_quiz(id_: str, file: str) -> str:
    """Returns the name by which a quiz is found: its id, or the name of its file where that is no valid id."""
    return id_ if ID.fullmatch(id_) else Path(file).stem
