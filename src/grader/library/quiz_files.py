"""The files of quizzes: JSON, and Markdown that stands for it."""

from pathlib import Path

from grader.errors import Fault
from grader.library.files import QUIZ_BYTES_MAX, list_files, read_text
from grader.library.json_text import parse_json
from grader.library.quiz_source import QuizSource

MARKDOWN = ".md"
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


def outline_quiz(root: Path, file: str) -> tuple[str, list[str]] | None:
    """Returns the id of a quiz and those of its questions, also where they have faults; None for what is no quiz."""
    text = read_text(root, file, QUIZ_BYTES_MAX)
    if isinstance(text, Fault):
        return None
    source = parse_quiz(text, file)
    if is_markdown(file):
        named = source.raw["id"] if source.raw is not None else Path(file).stem
        return str(named), list(source.questions)
    if not isinstance(source.raw, dict) or not isinstance(source.raw.get("id"), str):
        return None
    items = source.raw.get("questions")
    questions = enumerate(items if isinstance(items, list) else [], 1)
    return source.raw["id"], [str(item.get("id", f"q{at}")) for at, item in questions if isinstance(item, dict)]
